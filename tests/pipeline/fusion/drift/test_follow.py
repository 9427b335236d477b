"""A knocked mount is reported by vehicles that lie beside their boxes, and by nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pytest

from pipeline.alignment.projection import resolve
from pipeline.fusion.drift.follow import Drift, DriftState, Seen, follow
from pipeline.lidar.road_profile import RoadProfile
from pipeline.params import AlignmentParams, FusionParams
from tests.pipeline.calibration.alignment.made_drive import CAMERA, ROAD_M, SIZE
from tests.pipeline.fusion.drift.traffic import FRAME_NS, PLACES, seen

PARAMS = FusionParams()
RIGHT = AlignmentParams()


def told(frames: Iterable[Seen], alignment: Callable[[int], AlignmentParams] = lambda k: RIGHT) -> list[Drift | None]:
    """The reports of each frame. alignment: the one in use in a frame."""
    state, found = DriftState(), []
    for k, frame in enumerate(frames):
        params = alignment(k)
        state, drift = follow(state, frame, resolve(params, CAMERA), params, PARAMS)
        found.append(drift)
    return found


@pytest.mark.parametrize(
    "turned", [{"yaw_deg": 1.0}, {"yaw_deg": -2.0}, {"pitch_deg": 1.0}, {"pitch_deg": -1.0, "yaw_deg": 1.0}], ids=str
)
def test_a_turned_camera_is_reported_with_its_angles(turned: dict[str, float]):
    wrong = AlignmentParams().model_copy(update=turned)
    found = told(seen(k, wrong) for k in range(60))[-1]
    assert found is not None
    assert found.yaw_deg == pytest.approx(turned.get("yaw_deg", 0.0), abs=0.3)
    assert found.pitch_deg == pytest.approx(turned.get("pitch_deg", 0.0), abs=0.3)
    assert found.since is None
    assert "Align" in found.note


def test_a_right_mount_is_never_reported():
    assert not any(told(seen(k, RIGHT) for k in range(150)))


@pytest.mark.parametrize("places", [PLACES, PLACES[1:2]], ids=["traffic", "one lead"])
def test_a_knock_is_reported_since_its_frame(places: tuple[tuple[float, float], ...]):
    knocked = AlignmentParams(yaw_deg=1.5)
    found = told(seen(k, knocked if k >= 100 else RIGHT, places) for k in range(250))
    assert not any(found[:100])
    last = found[-1]
    assert last is not None
    assert last.yaw_deg == pytest.approx(1.5, abs=0.3)
    assert last.since is not None
    assert abs(int(last.since) - 100) <= 20
    assert f"frame {last.since}" in last.note


@pytest.mark.parametrize(("sigma_m", "is_told"), [(0.03, True), (0.25, False)], ids=["known", "hardly known"])
def test_where_the_road_is_hardly_known_vehicles_tell_no_pitch(sigma_m: float, is_told: bool):
    """All vehicles stand on the same road, so its error looks like a pitch of the camera."""
    road = RoadProfile(np.array([ROAD_M, 0.0, 0.0, 0.0]), np.diag([sigma_m**2, 0.0, 0.0, 0.0]))
    knocked = AlignmentParams(pitch_deg=1.0)
    assert (told(seen(k, knocked)._replace(road=road) for k in range(80))[-1] is not None) is is_told
    turned = told(seen(k, AlignmentParams(yaw_deg=1.0))._replace(road=road) for k in range(80))[-1]
    assert turned is not None, "the yaw does not depend on the road"


def test_it_is_reported_until_the_alignment_is_changed():
    knocked = AlignmentParams(yaw_deg=1.5)
    nothing = [seen(k, RIGHT, ()) for k in range(60, 500)]
    frames = [*(seen(k, knocked) for k in range(60)), *nothing]
    assert all(told(frames)[60:]), "also while nobody is ahead, longer than is remembered"
    corrected = told([seen(k, knocked) for k in range(160)], lambda k: knocked if k >= 60 else RIGHT)
    assert corrected[59] is not None
    assert not any(corrected[60:])


def test_it_is_dropped_when_vehicles_show_otherwise():
    knocked = AlignmentParams(yaw_deg=1.5)
    frames = [seen(k, knocked) for k in range(60)] + [seen(k, RIGHT) for k in range(60, 460)]
    found = told(frames)
    assert found[59] is not None
    assert found[-1] is None


def test_a_late_image_is_no_turn():
    """A delay of 100 ms, with vehicles whose bearings change in both directions."""
    speeds = ((0.0, 0.6), (0.0, -1.2), (0.0, 1.4), (0.0, -1.6), (0.0, 2.0), (0.0, -1.5))
    assert not any(told(seen(k, RIGHT, PLACES, 0.1, speeds) for k in range(100)))


def test_without_an_alignment_or_an_image_nothing_is_compared():
    frame = seen(0, RIGHT)
    for each, aligned in ((frame, None), (frame._replace(image_size=None), resolve(RIGHT, CAMERA))):
        assert follow(DriftState(), each, aligned, RIGHT, PARAMS) == (DriftState(), None)
    state, drift = follow(DriftState(), frame._replace(boxes=None), resolve(RIGHT, CAMERA), RIGHT, PARAMS)
    assert drift is None
    assert not state.vehicles


def test_vehicles_that_change_their_size_are_other_vehicles():
    """A track that takes over its neighbour's box does not mean that the camera has turned."""
    aligned = resolve(RIGHT, CAMERA)
    state, _ = follow(DriftState(), seen(0, RIGHT, PLACES[1:2]), aligned, RIGHT, PARAMS)
    ((_, before),) = state.vehicles
    larger = seen(1, RIGHT, PLACES[1:2])
    box = larger.boxes[0]  # type: ignore[index]
    x1, y1, x2, y2 = box.detection.bbox
    grown = box.detection.__class__((x1, y1 - 0.4 * (y2 - y1), x2, y2), "car", 0.8)
    state, _ = follow(state, larger._replace(boxes=[box.__class__(grown, None, None, None)]), aligned, RIGHT, PARAMS)
    assert [each.number for _, each in state.vehicles] == [before.number + 1]


def test_the_state_stays_small():
    state, sizes, short = DriftState(), [], FusionParams(drift_s=30.0)
    for k in range(700):
        state, _ = follow(state, seen(k, RIGHT), resolve(RIGHT, CAMERA), RIGHT, short)
        sizes.append(len(state.rows) + len(state.names) + len(state.vehicles))
    assert max(sizes[350:]) <= max(sizes[:350]) + 10
    assert np.ptp(state.rows[:, 0]) * 0.5 <= short.drift_s
    assert short.drift_s * 1e9 * 2 < FRAME_NS * 700, "twice as long as is remembered"
    assert SIZE[0] > 0
