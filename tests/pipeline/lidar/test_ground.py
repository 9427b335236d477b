"""The road is found: on made-up sweeps exactly, on every real sweep as high as the labelled vehicles stand."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.bench.ground_reference import fit_ground_numpy
from pipeline.common.geometry import Cuboid
from pipeline.labels.formats.base import drive_of
from pipeline.labels.formats.registry import import_labels
from pipeline.labels.model import Origin
from pipeline.lidar.ground import Ground, fit_ground, follow_ground, no_higher_than
from pipeline.params import GroundParams
from pipeline.sources import open_source
from pipeline.types import F32
from pipeline.types.source import InParts
from tests.pipeline.lidar.scenes import Block, real_frames, road_height, scan

CAR_AHEAD: Block = (12.0, -0.9, -1.5, 16.0, 0.9, 0.0)
TRUCK_BESIDE: Block = (-6.0, -4.5, -1.5, 7.0, -2.0, 2.0)
OWN_ROOF: Block = (-1.6, -0.6, -0.4, -0.9, 0.6, -0.2)
VEHICLES = {"car", "van", "truck", "bus"}


def _fit(points: F32, **changes: float) -> Ground:
    return fit_ground(points, np.ones(len(points), np.bool_), GroundParams(**changes))  # type: ignore[arg-type]


@pytest.mark.parametrize("tilt_deg", [(0.0, 0.0), (4.0, 0.0), (0.0, -3.0), (-4.0, 3.0)], ids=str)
@pytest.mark.parametrize(
    "blocks",
    [[], [CAR_AHEAD], [TRUCK_BESIDE], [CAR_AHEAD, TRUCK_BESIDE, OWN_ROOF]],
    ids=["empty", "car", "truck", "all"],
)
def test_finds_the_plane_and_only_the_plane(blocks: list[Block], tilt_deg: tuple[float, float]) -> None:
    points = scan(blocks, tilt_deg=tilt_deg)
    ground = _fit(points)
    places = np.array([[-10.0, 0.0], [5.0, 3.0], [20.0, 0.0], [30.0, -4.0]])
    assert ground.height(places) == pytest.approx(road_height(places, 1.5, tilt_deg), abs=0.1)
    above = points[:, 2] - road_height(points[:, :2].astype(np.float64), 1.5, tilt_deg)
    near = np.hypot(points[:, 0], points[:, 1]) < 30.0
    assert ground.mask[near & (above < 0.05)].mean() > 0.99
    assert not ground.mask[near & (above > 0.4)].any()


def test_heights_are_over_the_plane_of_the_places_own_segment() -> None:
    planes = np.array([[0.0, 0.0, 1.0, 2.0], [0.0, 0.0, 1.0, 1.0]])
    ground = Ground(np.zeros(2, np.bool_), planes, np.array([-50.0, 0.0, 50.0]), np.array([True, True]))
    assert ground.height(np.array([[-5.0, 0.0], [5.0, 0.0], [99.0, 0.0]])) == pytest.approx([-2.0, -1.0, -1.0])
    points = np.array([[-5.0, 0.0, 0.0, 0.0], [5.0, 0.0, 0.0, 0.0]], np.float32)
    assert ground.above(points) == pytest.approx([2.0, 1.0])
    assert no_higher_than(ground, points, np.ones(2, np.bool_), 1.5).tolist() == [False, True]


@pytest.mark.parametrize("count", [0, 1, 5, 19])
def test_too_few_points_are_no_ground_rather_than_a_wrong_one(count: int) -> None:
    points = np.column_stack([np.linspace(3, 9, count), np.zeros((count, 2)), np.zeros(count)]).astype(np.float32)
    ground = _fit(points)
    assert not ground.fitted.any()
    assert not ground.mask.any()
    assert np.isnan(ground.height(np.array([[5.0, 0.0]]))).all()
    assert no_higher_than(ground, points, np.ones(count, np.bool_), 1.0).all()


def test_one_ring_across_the_road_carries_no_plane_of_its_own() -> None:
    y = np.linspace(-5.0, 5.0, 400)
    ring = np.column_stack([np.sqrt(40.0**2 - y**2), y, np.full(400, -1.2), np.zeros(400)])
    near = scan()
    near = near[(near[:, 0] > 0.0) & (near[:, 0] < 20.0) & (np.abs(near[:, 1]) < 5.0)]
    ground = _fit(np.vstack([near, ring]).astype(np.float32))
    assert not ground.fitted[-1]
    assert ground.planes[-1, 2] == pytest.approx(1.0, abs=1e-3)


def test_a_hedge_beside_the_car_does_not_lift_the_road_ahead() -> None:
    """It rises ahead, beside a narrow strip of road: a plane through both meets the road behind, but not the one ahead,
    and much of the road is below it."""
    rng = np.random.default_rng(3)
    areas = [[-50.0, -5.0, -8.0, 8.0], [-5.0, 5.0, -2.0, 3.0], [5.0, 50.0, -8.0, 8.0]]
    spans = np.repeat(areas, [4000, 1500, 4000], axis=0)
    road = np.column_stack([rng.uniform(*spans[:, :2].T), rng.uniform(*spans[:, 2:].T), np.full(len(spans), -1.7)])
    hedge = np.column_stack([rng.uniform(-5.0, 5.0, 2500), rng.uniform(-8.0, -3.0, 2500), np.zeros(2500)])
    hedge[:, 2] = -1.6 + 0.04 * (hedge[:, 0] + 5.0) + 0.1 * rng.random(2500)
    points = np.vstack([road, hedge])
    points = np.column_stack([points, np.zeros(len(points))]).astype(np.float32)
    points[:, 2] += rng.normal(0.0, 0.03, len(points))
    ground = _fit(points)
    assert ground.height(np.array([[-20.0, 0.0], [0.0, 0.0], [20.0, 0.0], [40.0, 0.0]])) == pytest.approx(-1.7, abs=0.1)


def test_the_road_goes_on_a_metre_behind_a_truck() -> None:
    """It leaves a few arcs of road to see, too short for a plane; as obstacles they would join the truck."""
    points = np.array([[0.0, 0.0, 0.0, 0.0]], np.float32)
    free, stuck = (_ahead_of_the_bumper(blocks) for blocks in ([], [(0.5, -1.25, -0.1, 8.0, 1.25, 3.0)]))
    road = fit_ground(free, np.ones(len(free), np.bool_), GroundParams())
    every, on_road = np.ones(len(stuck), np.bool_), stuck[:, 2] < -0.4
    assert not fit_ground(stuck, every, GroundParams()).mask.any()
    ground = follow_ground(stuck, every, GroundParams(), road)
    assert np.array_equal(ground.mask, on_road)
    assert ground.above(points) == pytest.approx([0.5], abs=0.02)
    assert not ground.fitted.any()
    again = follow_ground(stuck, every, GroundParams(), ground)
    assert np.array_equal(again.mask, on_road), "for as long as it lasts"
    assert follow_ground(free, np.ones(len(free), np.bool_), GroundParams(), again).fitted.any()


def _ahead_of_the_bumper(blocks: list[Block]) -> F32:
    points = scan(blocks, 0.5)
    return points[(points[:, 0] > 0.0) & (np.hypot(points[:, 0], points[:, 1]) < 12.0)]


def test_points_not_kept_neither_count_nor_are_ground() -> None:
    points = scan([CAR_AHEAD])
    keep = points[:, 1] < 0.0
    ground = fit_ground(points, keep, GroundParams())
    assert not ground.mask[~keep].any()
    moved = points.copy()
    moved[~keep, 2] += 30.0
    assert np.array_equal(fit_ground(moved, keep, GroundParams()).planes, ground.planes)


def test_the_same_sweep_gives_the_same_bytes() -> None:
    points = scan([CAR_AHEAD, TRUCK_BESIDE], tilt_deg=(3.0, 1.0))
    assert _fit(points).planes.tobytes() == _fit(points.copy()).planes.tobytes()


@settings(max_examples=25, deadline=None)
@given(st.floats(1.0, 2.2), st.floats(-4.0, 4.0), st.floats(-3.0, 3.0), st.integers(1, 8), st.integers(1, 8))
def test_compiled_and_plain_numpy_agree(
    height_m: float, roll_deg: float, pitch_deg: float, segments: int, iterations: int
) -> None:
    points = scan([CAR_AHEAD, TRUCK_BESIDE], height_m, (roll_deg, pitch_deg))
    rng = np.random.default_rng(1)
    points[:, :3] += rng.normal(0.0, 0.02, (len(points), 3)).astype(np.float32)
    keep, params = np.ones(len(points), np.bool_), GroundParams(segments=segments, iterations=iterations)
    ours, plain = fit_ground(points, keep, params), fit_ground_numpy(points, keep, params)
    assert np.array_equal(ours.fitted, plain.fitted)
    assert np.array_equal(ours.edges, plain.edges)
    assert ours.planes == pytest.approx(plain.planes, abs=1e-4, nan_ok=True)
    assert (ours.mask != plain.mask).mean() < 5e-4  # single against double precision, at the very edge of the band


def test_every_real_sweep(data_dir: Path) -> None:
    """Height and tilt in every frame; the same mask as in plain numpy; the road below labelled vehicles."""
    under_vehicles = []
    for frame, truth in real_frames(data_dir):
        assert frame.sweep is not None
        points = frame.sweep.points
        keep = np.ones(len(points), np.bool_)
        ground = fit_ground(points, keep, GroundParams())
        height_m, front_m = -ground.height(np.array([[0.0, 0.0], [25.0, 0.0]]))
        assert 1.3 < height_m < 1.9, frame.name  # both sensors sit on the roof
        assert abs(front_m - height_m) < 1.6, frame.name
        assert np.degrees(np.arccos(ground.planes[:, 2])).max() < 9.0, frame.name
        plain = fit_ground_numpy(points, keep, GroundParams())
        # sums in single against double precision: a point on the very edge of the band may fall to either side
        assert np.count_nonzero(ground.mask != plain.mask) <= 3, frame.name
        under_vehicles += _above_road(ground, [each.cuboid for each in truth if each.label in VEHICLES])
    error_m = np.abs(under_vehicles)
    assert len(error_m) > 100
    assert np.median(error_m) < 0.1
    assert error_m.max() < 0.35


def test_the_road_of_a_street_with_hedges_is_where_parked_cars_stand(data_dir: Path) -> None:
    """KITTI 0009: beside a hedge, the plane next to the car tilted and lifted the road ahead by up to 2.5 m."""
    source = open_source(f"kitti:{data_dir / 'kitti_0009/2011_09_26/2011_09_26_drive_0009_sync'}")
    assert isinstance(source, InParts)
    labels = import_labels(
        data_dir / "kitti_0009" / "label_02.txt", drive_of(source), "kitti-tracking", Origin("file", "test", 0)
    ).labels
    under_vehicles = []
    for index in range(30, len(source), 2):
        sweep = source.sweep(index)
        assert sweep is not None
        ground = _fit(sweep.points)
        there = [s.cuboid for t in labels.tracks for s in t.sightings if s.frame == index and t.label in VEHICLES]
        under_vehicles += _above_road(ground, [each for each in there if each is not None])
    error_m = np.abs(under_vehicles)
    assert len(error_m) > 50
    assert np.median(error_m) < 0.1
    assert error_m.max() < 0.35


def _above_road(ground: Ground, vehicles: Sequence[Cuboid]) -> list[float]:
    """How high the ground is above the undersides of those to 40 m."""
    near = [c for c in vehicles if np.hypot(*c.center[:2]) < 40.0 and abs(c.center[1]) < 12.0]
    return [float(ground.height(np.array([c.center[:2]]))[0] - (c.center[2] - c.size[2] / 2)) for c in near]
