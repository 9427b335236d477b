"""What each part of ranging brings: the distance of labelled vehicles with all parts, without one, and with one alone.

    python -m tests.soak.range_parts

Astyx frames of ``CIPV_DATA`` are processed one by one, KITTI 0009 (16 rings) in order. A labelled vehicle is found if
an object's box overlaps the projection of its cuboid by more than ``SAME_IOU``; its error is relative to the distance
of its nearest point. Vehicles of which labelled ones in front hide more than half are left out. *LiDAR cut off*: KITTI
0009 without sweeps from frame ``CUT_AT`` on, and only the vehicles that the LiDAR had ranged before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from pipeline.alignment.projection import project_cuboid, resolve
from pipeline.common.files.data_dir import data_dir
from pipeline.common.geometry import iou_matrix
from pipeline.detection import Detectors, detect, detector_for, far_view_for
from pipeline.experiments.robustness.measure import truths
from pipeline.params import Params, with_changes
from pipeline.simulation.sensors.truth_boxes import visible_part
from pipeline.sources import open_source
from pipeline.step import State, step
from pipeline.types import VEHICLES, Box, Frame, FusedObject, Result
from pipeline.types.source import TruthObject

SAME_IOU, CUT_AT, VISIBLE_SHARE = 0.4, 20, 0.5
BINS_M = (0.0, 20.0, 40.0, 60.0, 100.0)
PARTS: Mapping[str, str] = {
    "far view": "detection.far_view",
    "single returns": "fusion.single_returns",
    "merged clusters": "fusion.merged_clusters",
    "road contact": "fusion.use_ground_contact",
    "learned height": "vision_tracking.learn_height",
    "shape of the box": "vision_tracking.use_aspect",
}

Labelled = tuple[TruthObject, ...] | None
Drive = list[tuple[Frame, Labelled]]


@dataclass
class Errors:
    """Relative distance errors, by bin of the true distance; NaN for a vehicle that was not found."""

    by_bin: list[list[float]] = field(default_factory=lambda: [[] for _ in BINS_M[1:]])

    def cells(self) -> list[str]:
        """For each bin: found of labelled, median error and share within 5 %."""
        return [_cell(np.array(each)) for each in self.by_bin]


def _cell(errors: np.ndarray) -> str:
    if not len(errors):
        return "–"
    found = errors[~np.isnan(errors)]
    right = f"{100 * np.median(found):.1f} %, {100 * np.mean(found <= 0.05):.0f} %" if len(found) else "–"
    return f"{len(found)} of {len(errors)}: {right}"


def variants() -> Iterator[tuple[str, Params]]:
    none = dict.fromkeys(PARTS.values(), False)
    yield "all", _with({})
    for name, switch in PARTS.items():
        yield f"without {name}", _with({switch: False})
    yield "none of them", _with(none)
    for name, switch in PARTS.items():
        yield f"only {name}", _with({**none, switch: True})


def _with(changes: Mapping[str, Any]) -> Params:
    return with_changes(Params(), {"cipv.confirm_hits": 1, **changes})


def opened(uri: str, labels: str = "") -> Drive:
    """A recording's frames with the boxes of YOLOX-nano in both views, and its labels."""
    source = open_source(uri)
    network = detector_for(source, str(data_dir() / "models/yolox_nano.onnx"))
    detectors = Detectors(network, far=far_view_for(source, network))
    return [(detect(source.frame(index), detectors), truth) for index, truth in enumerate(truths(source, labels))]


def run(drive: Drive, params: Params, alone: bool, aside_m: float, cut_at: int | None = None) -> Errors:
    """Errors of one variant. alone: each frame is processed on its own. cut_at: no sweeps from this frame on."""
    errors, state, ranged = Errors(), State(), set[int]()
    for index, (frame, truth) in enumerate(drive):
        is_cut = cut_at is not None and index >= cut_at
        state, result = step(State() if alone else state, replace(frame, sweep=None) if is_cut else frame, params)
        if cut_at is None or is_cut:
            only = ranged if is_cut else None
            for distance_m, error in _errors(frame, truth, result, params, aside_m, only):
                errors.by_bin[int(np.searchsorted(BINS_M, distance_m, "right")) - 1].append(error)
        else:
            ranged |= {item.id for item in result.objects if item.ranged_now or item.returns}
    return errors


def _errors(
    frame: Frame, truth: Labelled, result: Result, params: Params, aside_m: float, only: set[int] | None
) -> Iterator[tuple[float, float]]:
    """True distance and relative error of each labelled vehicle. only: of these objects; others are left out."""
    aligned = resolve(params.alignment, frame.camera)
    assert aligned is not None
    assert frame.image is not None
    height, width = frame.image.bgr.shape[:2]
    items = [item for item in result.objects if item.imaged and item.bbox is not None and item.distance_m is not None]
    boxes = np.array([item.bbox for item in items]).reshape(-1, 4)
    nearer: list[Box] = []
    for item in sorted(truth or (), key=_distance_m):
        drawn = project_cuboid(aligned, item.cuboid.corners(), width, height)
        if drawn is None or item.label not in VEHICLES:
            continue
        _, visible = visible_part(drawn, nearer)
        nearer.append(drawn)
        distance_m = _distance_m(item)
        if visible < VISIBLE_SHARE or abs(item.cuboid.center[1]) > aside_m or distance_m >= BINS_M[-1]:
            continue
        found = _best(items, boxes, drawn)
        if only is None or (found is not None and found.id in only):
            yield distance_m, abs((found.distance_m or 0.0) / distance_m - 1.0) if found is not None else np.nan


def _distance_m(item: TruthObject) -> float:
    corners = item.cuboid.corners()
    return float(np.hypot(corners[:, 0], corners[:, 1]).min())


def _best(items: Sequence[FusedObject], boxes: np.ndarray, drawn: Sequence[float]) -> FusedObject | None:
    overlap = iou_matrix(boxes, np.array([drawn]))[:, 0]
    return items[int(overlap.argmax())] if len(items) and overlap.max() > SAME_IOU else None


def main() -> None:
    folder = data_dir()
    astyx = [*opened(f"astyx:{folder / 'astyx'}"), *opened(f"astyx:{folder / 'astyx_more'}")]
    drive = next((folder / "kitti_0009/2011_09_26").glob("*_sync"))
    kitti = opened(f"kitti:{drive}", str(folder / "kitti_0009/label_02.txt"))
    heads = " | ".join(f"{low:.0f}–{high:.0f} m" for low, high in pairwise(BINS_M))
    for title, frames, alone, aside_m, cut_at in (
        ("Astyx", astyx, True, 1.8, None),
        ("KITTI 0009", kitti, False, np.inf, None),
        (
            "KITTI 0009, camera alone",
            [(replace(frame, sweep=None), truth) for frame, truth in kitti],
            False,
            np.inf,
            None,
        ),
        ("KITTI 0009, LiDAR cut off", kitti, False, np.inf, CUT_AT),
    ):
        print(f"\n| {title} | {heads} |\n|---|{'---|' * (len(BINS_M) - 1)}")
        for name, params in variants():
            print(f"| {name} |", " | ".join(run(frames, params, alone, aside_m, cut_at).cells()), "|", flush=True)


if __name__ == "__main__":
    main()
