"""The whole pipeline on a small scene: the same inputs give the same bytes, and a missing branch never stops it."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Callable

import numpy as np
import pytest

from pipeline.params import Params, preset, with_changes
from pipeline.sources import open_source
from pipeline.step import State, step
from pipeline.types import F32, Frame, RawBoxes, Result
from pipeline.types.result_json import write_line


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    """Eight simulated frames with the boxes of a perfect detector."""
    source = open_source("sim:straight")
    return [dataclasses.replace(source.frame(i), raw_boxes=_perfect_boxes(source, i)) for i in range(8)]


def _perfect_boxes(source: object, index: int) -> RawBoxes:
    from pipeline.alignment.projection import project_cuboid, resolve

    frame, truth = source.frame(index), source.truth(index)  # type: ignore[attr-defined]
    aligned = resolve(Params().alignment, frame.camera)
    assert aligned is not None
    ahead = [item for item in truth if item.cuboid.center[0] > 5.0]
    found = [
        (project_cuboid(aligned, item.cuboid.corners(), frame.camera.width, frame.camera.height), item.label)
        for item in ahead
    ]
    kept = [(box, label) for box, label in found if box is not None]
    boxes = np.array([box for box, _ in kept], np.float32).reshape(-1, 4)
    return RawBoxes("perfect", boxes, np.full(len(kept), 0.9, np.float32), tuple(label for _, label in kept))


def drive(frames: list[Frame], params: Params) -> list[Result]:
    state, results = State(), []
    for frame in frames:
        state, result = step(state, frame, params)
        results.append(result)
    return results


def as_bytes(results: list[Result]) -> bytes:
    out = io.StringIO()
    for result in results:
        write_line(out, dataclasses.replace(result, timing_ms={}))
    return out.getvalue().encode()


@pytest.mark.parametrize("forgets", [True, False])
def test_a_height_learned_from_another_vehicle_is_forgotten_at_once(frames: list[Frame], forgets: bool) -> None:
    """The detector misses a car at 14 m, and boxes one behind it, with which its cluster is joined; then it boxes
    both."""
    params = with_changes(Params(), {"vision_tracking.forget_heights": forgets})
    state, results = State(), []
    for number, frame in enumerate(frames):
        raw = frame.raw_boxes
        assert raw is not None
        x1, y1, x2, y2 = (float(each) for each in raw.boxes[1])
        w, h = x2 - x1, y2 - y1
        behind = (x1 - 0.12 * w, y1 + 0.1 * h, x1 + 0.6 * w, y1 + 0.95 * h)
        boxes = [behind, (x1, y1, x2, y2)] if number == len(frames) - 1 else [behind]
        count = len(boxes)
        seen = RawBoxes("two", np.array(boxes, np.float32), np.full(count, 0.9, np.float32), ("car",) * count)
        state, result = step(state, dataclasses.replace(frame, raw_boxes=seen), params)
        results.append(result)
    before, after = ([item for item in result.objects if item.imaged] for result in results[-2:])
    (joined,) = [item for item in before if item.source == "VL"]
    (alone,) = [item for item in after if item.source == "V"]
    assert [item.lidar_track for item in after if item.source == "VL"] == [joined.lidar_track]
    assert joined.distance_m is not None
    assert alone.distance_m is not None
    assert (alone.distance_m > 1.1 * joined.distance_m) == forgets
    assert (alone.height_from == "range") != forgets


@pytest.mark.parametrize("name", ["default", "paper"])
def test_the_same_input_twice_gives_the_same_bytes(frames: list[Frame], name: str) -> None:
    first, second = (as_bytes(drive(frames, preset(name))) for _ in range(2))
    assert first == second
    assert as_bytes(drive(frames, with_changes(preset(name), {"path.half_width_m": 0.6}))) != first


def test_a_frame_can_be_run_again_from_the_state_before_it(frames: list[Frame]) -> None:
    """As with a slider on a paused frame: runs in between have no effect."""
    state = State()
    for frame in frames[:-1]:
        state, _ = step(state, frame, Params())
    _, first = step(state, frames[-1], Params())
    step(state, frames[-1], with_changes(Params(), {"cluster.tolerance_m": 2.5, "fusion.min_iou": 0.9}))
    _, again = step(state, frames[-1], Params())
    assert as_bytes([again]) == as_bytes([first])


def test_the_lead_is_found_by_both_sensors(frames: list[Frame]) -> None:
    last = drive(frames, Params())[-1]
    assert last.cipv is not None
    lead = next(item for item in last.objects if item.id == last.cipv.id)
    assert last.acc is not None
    assert lead.label in ("car", "truck")


@pytest.mark.parametrize(
    ("missing", "kinds"),
    [
        pytest.param({"raw_boxes": None, "image": None}, {"L"}, id="camera lost: LiDAR goes on alone"),
        pytest.param({"sweep": None}, {"V"}, id="LiDAR lost: the camera goes on alone"),
        pytest.param({"sweep": None, "raw_boxes": None, "image": None}, set(), id="both lost"),
        pytest.param({"camera": None}, {"L", "V"}, id="no calibration: nothing can be joined"),
    ],
)
def test_a_missing_branch(frames: list[Frame], missing: dict[str, None], kinds: set[str]) -> None:
    results = drive([dataclasses.replace(frame, **missing) for frame in frames], Params())
    assert {item.source for result in results for item in result.objects} == kinds


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(lambda p: p[:1], id="one point"),
        pytest.param(lambda p: np.repeat(p[:1], len(p), axis=0), id="every point the same"),
        pytest.param(np.zeros_like, id="every point at the origin"),
        pytest.param(lambda p: p * np.array([1, 0, 0, 1], np.float32), id="all in one direction"),
        pytest.param(lambda p: p * np.array([0, 0, 1, 1], np.float32), id="one upright line"),
        pytest.param(lambda p: p * np.array([1, 1, 0, 1], np.float32), id="all at one height"),
    ],
)
def test_a_damaged_sweep_stops_nothing_and_the_camera_still_sees(
    frames: list[Frame], damage: Callable[[F32], F32]
) -> None:
    """The third sweep of a drive, and the first of one."""
    for at in (2, 0):
        damaged = list(frames[:5])
        sweep = damaged[at].sweep
        assert sweep is not None
        points = damage(sweep.points)
        time_s = sweep.time_s[: len(points)] if sweep.time_s is not None else None
        shown = dataclasses.replace(sweep, points=points, ring=sweep.ring[: len(points)], time_s=time_s)
        damaged[at] = dataclasses.replace(frames[at], sweep=shown)
        results = drive(damaged, Params())
        assert any("V" in item.source for item in results[at].objects)
        assert results[-1].cipv is not None


def test_a_sensor_lost_midway_is_carried_and_says_so(frames: list[Frame]) -> None:
    hurt = [*frames[:5], dataclasses.replace(frames[5], sweep=None, notes=("LiDAR: file missing",))]
    last = drive(hurt, Params())[-1]
    carried = [item for item in last.objects if item.lidar_track is not None]
    assert carried
    assert all("L" not in item.seen_by for item in carried)
    assert any(item.carried for item in carried)
    assert last.sensors.lidar_age_ms is None
    assert last.notes == ("LiDAR: file missing",)


def test_no_ego_state_no_speed_over_ground_and_no_pedals(frames: list[Frame]) -> None:
    unmeasured = with_changes(Params(), {"motion.source": "can"})
    last = drive([dataclasses.replace(frame, ego=None) for frame in frames], unmeasured)[-1]
    assert last.acc is None
    assert all(item.speed_over_ground_mps is None and item.moving is None for item in last.objects)


def test_the_lidar_gives_own_motion_where_nothing_else_does(frames: list[Frame]) -> None:
    """At 20 m/s behind a car of the same speed: without ego speed, nothing shows that it drives."""
    last = drive([dataclasses.replace(frame, ego=None, gnss=None) for frame in frames], Params())[-1]
    assert last.own_motion is not None
    assert last.own_motion.speed.source == "lidar"
    assert last.acc is not None
    assert last.ego is not None
    assert last.ego.speed_mps == pytest.approx(20.0, abs=4 * last.own_motion.speed.speed_sigma_mps)
    assert any(item.moving for item in last.objects)


def test_after_a_gap_every_tracker_starts_anew_and_no_number_is_used_twice(frames: list[Frame]) -> None:
    later = [dataclasses.replace(frame, t_ns=frame.t_ns + 60_000_000_000) for frame in frames[:2]]
    results = drive([*frames[:4], *later], Params())
    before = {item.id for result in results[:4] for item in result.objects}
    after = {item.id for item in results[4].objects}
    assert after
    assert not before & after
    assert all(item.hits == 1 for item in results[4].objects)


def test_time_running_backwards_starts_anew(frames: list[Frame]) -> None:
    results = drive([frames[3], frames[2]], Params())
    assert all(item.hits == 1 for item in results[1].objects)


def test_every_point_is_accounted_for(frames: list[Frame]) -> None:
    for result in drive(frames, with_changes(Params(), {"downsample.keep_every": 2})):
        kind = result.layers.kind
        assert len(kind) == len(result.layers.points)
        assert {-3, -1} <= set(np.unique(kind))
        assert kind.max() == len(result.layers.obstacles) - 1
