from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.geometry import iou_matrix
from pipeline.params import DetectionParams
from pipeline.types import VEHICLES, RawBoxes
from pipeline.vision.nms import select

A, A_SHIFTED, B = (0, 0, 100, 80), (4, 0, 104, 80), (300, 0, 400, 80)


def _raw(*rows: tuple[tuple[float, ...], str, float]) -> RawBoxes:
    boxes = np.array([box for box, _, _ in rows], np.float32).reshape(-1, 4)
    return RawBoxes(
        "test", boxes, np.array([score for *_, score in rows], np.float32), tuple(label for _, label, _ in rows)
    )


def _kept(raw: RawBoxes, **changes: float) -> list[tuple[str, float]]:
    return [(d.label, round(d.score, 2)) for d in select(raw, DetectionParams(**changes))]


def test_the_better_of_two_boxes_on_one_object_stays() -> None:
    assert _kept(_raw((A, "car", 0.6), (A_SHIFTED, "car", 0.8), (B, "car", 0.5))) == [("car", 0.8), ("car", 0.5)]


def test_low_scores_are_dropped() -> None:
    assert _kept(_raw((A, "car", 0.29), (B, "car", 0.31))) == [("car", 0.31)]


def test_a_vehicle_of_two_names_is_one_object() -> None:
    assert _kept(_raw((A, "truck", 0.9), (A_SHIFTED, "car", 0.4))) == [("truck", 0.9)]


def test_a_doubtful_bus_is_a_car() -> None:
    raw = _raw((A, "bus", 0.65), (A_SHIFTED, "car", 0.57))
    assert _kept(raw) == [("car", 0.65)]
    assert _kept(raw, car_prior=1.0) == [("bus", 0.65)]
    assert select(raw, DetectionParams())[0].bbox == A


def test_a_rider_stays_beside_the_motorcycle() -> None:
    raw = _raw((A, "motorcycle", 0.9), (A_SHIFTED, "person", 0.8))
    assert _kept(raw) == [("motorcycle", 0.9), ("person", 0.8)]


def test_what_is_never_on_a_road_is_dropped() -> None:
    raw = _raw((A, "suitcase", 0.9), (B, "person", 0.5), (A, "traffic light", 0.8), (A, "reindeer", 0.4))
    assert _kept(raw) == [("person", 0.5), ("reindeer", 0.4)], "an unknown class may be a road user"
    assert len(_kept(raw, road_users_only=False)) == 4


def test_a_train_on_a_road_is_a_bus() -> None:
    assert _kept(_raw((A, "train", 0.9), (B, "train", 0.5), (B, "truck", 0.4))) == [("bus", 0.9), ("bus", 0.5)]
    assert _kept(_raw((A, "train", 0.5), (A_SHIFTED, "car", 0.4))) == [("car", 0.5)]


def test_ties_keep_the_detectors_order() -> None:
    assert [d.bbox[0] for d in select(_raw((B, "car", 0.5), (A, "car", 0.5)), DetectionParams())] == [300, 0]


def test_no_candidates_no_detections() -> None:
    assert select(_raw(), DetectionParams()) == ()


_rows = st.tuples(
    st.tuples(*[st.integers(0, 60)] * 2, *[st.integers(61, 120)] * 2),
    st.sampled_from(["car", "truck", "bus", "person"]),
    st.floats(0.05, 1.0),
)


@given(st.lists(_rows, max_size=20))
def test_survivors_do_not_overlap_and_nothing_else_is_lost(rows: list) -> None:
    raw, params = _raw(*rows), DetectionParams()
    kept = select(raw, params)
    assert [d.score for d in kept] == sorted((d.score for d in kept), reverse=True)
    kinds = ["vehicle" if d.label in VEHICLES else d.label for d in kept]
    overlap = iou_matrix(np.array([d.bbox for d in kept]), np.array([d.bbox for d in kept]))
    for i in range(len(kept)):
        assert all(overlap[i, j] <= params.nms_iou for j in range(i) if kinds[i] == kinds[j])
    for box, label, score in zip(raw.boxes, raw.labels, raw.scores, strict=True):
        kind = "vehicle" if label in VEHICLES else label
        same = [d.bbox for d, other in zip(kept, kinds, strict=True) if other == kind]
        if score >= params.min_score:
            assert same
            assert iou_matrix(box[None], np.array(same)).max() > params.nms_iou
