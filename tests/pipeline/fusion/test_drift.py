"""A knocked mount is told by vehicles that lie beside their boxes, and by nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.alignment.projection import project_cuboid, resolve
from pipeline.common.geometry import Cuboid
from pipeline.fusion.drift import FEWEST_FRAMES, CuboidOffset, Drift, DriftState, follow, judge
from pipeline.fusion.fuse import Fusion
from pipeline.params import AlignmentParams, FusionParams
from tests.pipeline.build import fused
from tests.pipeline.calibration.alignment.made_drive import CAMERA, ROAD_M, SIZE

PARAMS = FusionParams()
PLACES = ((12.0, -3.0), (18.0, 0.5), (22.0, 4.0), (30.0, -5.0), (35.0, 3.0), (26.0, -8.0))


def seen(turned: AlignmentParams, number: int, jitter_px: float = 1.5, wide: float = 1.0) -> Fusion:
    """One frame of six cars, their boxes where a camera turned so sees them."""
    aligned, rng = resolve(turned, CAMERA), np.random.default_rng(number)
    assert aligned is not None
    objects, boxes = [], {}
    for k, (x, y) in enumerate(PLACES):
        item = fused(k, x, y, "VL")
        cuboid = Cuboid((x + 0.1, y, ROAD_M + 0.75), (0.2, 1.7 * wide, 1.5), 0.0)
        right = project_cuboid(aligned, cuboid._replace(size=(0.2, 1.7, 1.5)).corners(), *SIZE)
        assert right is not None
        lasting = np.random.default_rng(1000 + k).normal(0.0, 0.04, 4) * (right[3] - right[1])
        box = np.array(right) + lasting + rng.normal(0.0, jitter_px, 4)
        boxes[k] = (float(box[0]), float(box[1]), float(box[2]), float(box[3]))
        objects.append(replace(item, cuboid=cuboid, distance_m=float(np.hypot(x, y))))
    return Fusion(tuple(objects), {}, boxes)


def after(frames: int, drift_s: float = 30.0, wide: float = 1.0, **turned: float) -> Drift | None:
    aligned, state, found = resolve(AlignmentParams(), CAMERA), DriftState(), None
    params = PARAMS.model_copy(update={"drift_s": drift_s})
    for k in range(frames):
        frame = seen(AlignmentParams().model_copy(update=turned), k, wide=wide)
        state, found = follow(state, frame, aligned, SIZE, k * 100_000_000, params)
    return found


@pytest.mark.parametrize(
    "turned", [{"yaw_deg": 1.0}, {"yaw_deg": -2.0}, {"pitch_deg": 1.0}, {"pitch_deg": -1.0, "yaw_deg": 1.0}], ids=str
)
def test_a_turned_camera_is_told_with_its_angles(turned: dict[str, float]):
    found = after(20, **turned)
    assert found is not None
    assert found.yaw_deg == pytest.approx(turned.get("yaw_deg", 0.0), abs=0.35)
    assert found.pitch_deg == pytest.approx(turned.get("pitch_deg", 0.0), abs=0.35)
    assert found.vehicles == len(PLACES)
    assert "Align" in found.note


def test_a_right_mount_is_never_told():
    assert after(60) is None


def test_it_takes_some_frames():
    assert after(FEWEST_FRAMES - 1, yaw_deg=2.0) is None


def test_clusters_of_another_width_say_nothing():
    assert after(20, wide=1.6, yaw_deg=2.0) is None


def vehicles(*yaws_deg: float) -> tuple[CuboidOffset, ...]:
    return tuple(CuboidOffset(k, 0, 20, yaw, 0.0, 3.0) for k, yaw in enumerate(yaws_deg))


@pytest.mark.parametrize(
    ("yaws_deg", "told"),
    [
        ((1.5, 1.4), False),
        ((1.5, 1.4, 1.6), True),
        ((0.1, -0.1, 6.0, 0.0), False),
        ((3.0, -3.0, 2.5, -2.0, 2.8), False),
        ((0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3), False),
    ],
    ids=["few", "enough", "one wrong pair", "crossing both ways", "too small to matter"],
)
def test_vehicles_must_agree(yaws_deg: tuple[float, ...], told: bool):
    assert (judge(vehicles(*yaws_deg), PARAMS) is not None) is told


def test_a_wrong_time_between_the_sensors_is_no_angle():
    """Bearings that all change the same way are off the same way."""
    off = (0.8, 0.75, 0.82, 0.78)
    told = [judge(tuple(each._replace(rate_degps=rate) for each in vehicles(*off)), PARAMS) for rate in (0.0, 5.0)]
    assert [each is not None for each in told] == [True, False]
    both_ways = tuple(
        CuboidOffset(k, 0, 20, 1.5 + 0.05 * rate, 0.0, 3.0, rate) for k, rate in enumerate((5.0, -5.0, 3.0, -4.0))
    )
    found = judge(both_ways, PARAMS)
    assert found is not None
    assert found.yaw_deg == pytest.approx(1.5, abs=0.1)


def test_a_camera_that_is_knocked_on_the_way_is_told_by_the_cars_that_stay():
    aligned, state, found = resolve(AlignmentParams(), CAMERA), DriftState(), []
    for k in range(170):
        turned = AlignmentParams(yaw_deg=1.5 if k >= 100 else 0.0)
        state, told = follow(state, seen(turned, k), aligned, SIZE, k * 100_000_000, PARAMS)
        found.append(told)
    assert not any(found[:100])
    first = next(k for k, told in enumerate(found) if told is not None)
    assert first < 150
    assert found[-1] is not None
    assert found[-1].yaw_deg == pytest.approx(1.5, abs=0.3)


def test_a_side_that_the_lidar_does_not_meet_is_no_angle():
    """Trucks in the next lane: the box begins at the far end of the side, the cluster is the rear alone."""
    aligned, state, found = resolve(AlignmentParams(), CAMERA), DriftState(), None
    assert aligned is not None
    for k in range(20):
        objects, boxes = [], {}
        for number, (x, y) in enumerate(((14.0, -3.5), (20.0, -3.6), (27.0, -3.4), (33.0, -3.5))):
            truck = Cuboid((x + 6.0, y, ROAD_M + 1.9), (12.0, 2.5, 3.8), 0.0)
            box = project_cuboid(aligned, truck.corners(), *SIZE)
            assert box is not None
            rear = Cuboid((x + 0.1, y, ROAD_M + 1.9), (0.2, 2.5, 3.8), 0.0)
            item = replace(fused(number, x, y, "VL"), cuboid=rear, distance_m=float(np.hypot(x, y)))
            objects.append(item)
            boxes[number] = box
        state, found = follow(state, Fusion(tuple(objects), {}, boxes), aligned, SIZE, k * 100_000_000, PARAMS)
        assert found is None
    assert sum(each.frames >= FEWEST_FRAMES for each in state.sightings) >= 2, "they were looked at"


def test_vehicles_that_are_passed_and_parts_of_vehicles_say_nothing():
    aligned = resolve(AlignmentParams(), CAMERA)
    frame = seen(AlignmentParams(yaw_deg=2.0), 0)
    passed = tuple(replace(item, velocity_mps=(-30.0, 0.0)) for item in frame.objects)
    state, _ = follow(DriftState(), replace(frame, objects=passed), aligned, SIZE, 0, PARAMS)
    assert len(state.sightings) < len(PLACES)
    parts = tuple(
        replace(item, cuboid=item.cuboid._replace(size=(0.2, 1.1, 1.5))) for item in frame.objects if item.cuboid
    )
    assert follow(DriftState(), replace(frame, objects=parts), aligned, SIZE, 0, PARAMS)[0] == DriftState()


def test_what_is_long_gone_is_forgotten():
    aligned = resolve(AlignmentParams(), CAMERA)
    old = DriftState(vehicles(1.5, 1.4, 1.6, 1.5))
    nothing = replace(seen(AlignmentParams(), 0), objects=())
    state, found = follow(old, nothing, aligned, SIZE, 29_000_000_000, PARAMS)
    assert found is not None
    assert state == old
    assert follow(state, nothing, aligned, SIZE, 31_000_000_000, PARAMS) == (DriftState(), None)
