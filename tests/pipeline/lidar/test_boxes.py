"""Cuboids: turned as the object is, standing on the road, no larger than what was seen."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from pipeline.common.geometry import rotation
from pipeline.lidar.boxes import MIN_AREA_M2, fit_obstacles
from pipeline.lidar.ground import Ground
from pipeline.params import BoxParams
from pipeline.types import Obstacle

ROAD = Ground(np.zeros(0, np.bool_), np.array([[0.0, 0.0, 1.0, 1.5]]), np.array([-50.0, 50.0]), np.ones(1, np.bool_))
NO_ROAD = Ground(np.zeros(0, np.bool_), np.full((1, 4), np.nan), np.array([-50.0, 50.0]), np.zeros(1, np.bool_))
Points = npt.NDArray[np.float64]


def _vehicle(length_m: float, width_m: float, yaw_deg: float, at: tuple[float, float]) -> Points:
    """(N, 3) points on the rear and the right side of a box, from 1 m to 2 m above the road of ``ROAD``."""
    rear = [(-length_m / 2, y, z) for y in np.linspace(-width_m / 2, width_m / 2, 20) for z in (-0.5, 0.5)]
    side = [(x, -width_m / 2, z) for x in np.linspace(-length_m / 2, length_m / 2, 20) for z in (-0.5, 0.5)]
    return np.array(rear + side) @ rotation(0.0, 0.0, np.radians(yaw_deg)).T + [*at, 0.0]


def _fit(xyz: Points, ground: Ground = ROAD, **changes: object) -> Obstacle:
    points = np.column_stack([xyz, np.zeros(len(xyz))]).astype(np.float32)
    params = BoxParams(**changes)  # type: ignore[arg-type]
    (obstacle,) = fit_obstacles(points, np.zeros(len(points), np.int32), ground, params)
    return obstacle


@pytest.mark.parametrize(
    ("yaw_deg", "expected_deg"), [(0, 0), (10, 10), (-30, -30), (44, 44), (60, 60), (90, 90), (-90, 90), (150, -30)]
)
def test_an_l_of_two_sides_gives_the_turn_and_size_of_a_long_vehicle(yaw_deg: float, expected_deg: float) -> None:
    box = _fit(_vehicle(4.5, 1.8, yaw_deg, (20.0, 3.0)), yaw_step_deg=2.0).cuboid
    assert np.degrees(box.yaw_rad) == pytest.approx(expected_deg, abs=1.01)
    assert -np.pi / 2 < box.yaw_rad <= np.pi / 2
    assert box.size[:2] == pytest.approx((4.5, 1.8), abs=0.1)
    assert box.center[:2] == pytest.approx((20.0, 3.0), abs=0.1)


@pytest.mark.parametrize("yaw_deg", [-20.0, 0.0, 6.0, 30.0])
def test_a_rear_alone_is_wide_not_long(yaw_deg: float) -> None:
    """Seen from behind, a car is a wall 1.6 m wide; its long axis still points along the road."""
    wall = np.array([(0.0, y, z) for y in np.linspace(-0.8, 0.8, 15) for z in (-0.6, 0.3)])
    box = _fit(wall @ rotation(0.0, 0.0, np.radians(yaw_deg)).T + [18.0, 0.0, 0.0]).cuboid
    assert np.degrees(box.yaw_rad) == pytest.approx(yaw_deg, abs=1.01)
    assert box.size[1] == pytest.approx(1.6, abs=0.05)
    assert box.size[0] < 0.15


def test_a_side_longer_than_any_rear_is_a_length_whichever_way_it_lies() -> None:
    crossing = np.array([(25.0, y, z) for y in np.linspace(-4.0, 4.0, 60) for z in (-0.6, 0.8)])
    box = _fit(crossing).cuboid
    assert box.yaw_rad == pytest.approx(np.pi / 2)
    assert box.size[0] == pytest.approx(8.0, abs=0.05)


def test_axis_aligned_boxes_lie_along_ego_x_and_y() -> None:
    xyz = _vehicle(2.4, 1.8, 30.0, (15.0, -2.0))
    box = _fit(xyz, method="axis_aligned").cuboid
    assert box.yaw_rad == 0.0
    low, high = xyz.min(axis=0), xyz.max(axis=0)
    assert box.size[:2] == pytest.approx(tuple(high[:2] - low[:2]), abs=1e-5)
    assert box.center[:2] == pytest.approx(tuple((high[:2] + low[:2]) / 2), abs=1e-5)


@pytest.mark.parametrize(
    ("lowest_m", "ground", "bottom_m"),
    [(-0.6, ROAD, -1.5), (-0.2, ROAD, -0.2), (-0.6, NO_ROAD, -0.6), (-1.8, ROAD, -1.8)],
    ids=["ring above the road", "sign overhead", "no road found", "below the road"],
)
def test_stands_on_the_road_when_near_it(lowest_m: float, ground: Ground, bottom_m: float) -> None:
    wall = np.array([(10.0, y, z) for y in np.linspace(-0.8, 0.8, 9) for z in (lowest_m, 0.5)])
    box = _fit(wall, ground, ground_gap_m=1.2).cuboid
    assert box.center[2] - box.size[2] / 2 == pytest.approx(bottom_m, abs=1e-5)
    assert box.center[2] + box.size[2] / 2 == pytest.approx(0.5, abs=1e-5)


def test_the_closest_point_is_a_point_of_the_cluster_by_horizontal_range() -> None:
    obstacle = _fit(np.array([(12.0, 0.5, 0.0), (11.0, 4.0, 0.0), (11.5, 1.0, 9.0), (13.0, 0.0, 0.0)]))
    assert obstacle.closest_point == pytest.approx((11.5, 1.0, 9.0))


def test_count_density_and_spread_describe_the_points() -> None:
    xyz = _vehicle(4.0, 2.0, 0.0, (20.0, 0.0))
    obstacle = _fit(xyz)
    assert obstacle.points == 80
    assert obstacle.density == pytest.approx(80 / (4.0 * 2.0), rel=0.01)
    assert obstacle.spread == pytest.approx(tuple(xyz.std(axis=0)), abs=1e-3)


def test_a_single_ring_on_a_flat_rear_has_a_finite_density() -> None:
    obstacle = _fit(np.array([(20.0, y, 0.0) for y in np.linspace(-0.8, 0.8, 5)]))
    assert obstacle.density == pytest.approx(5 / MIN_AREA_M2)
    assert min(obstacle.cuboid.size) > 0.0


def test_obstacles_come_in_the_order_of_their_labels() -> None:
    points = np.array([(20, 0, 0, 0), (9, 0, 0, 0), (20, 1, 0, 0), (9, 1, 0, 0), (3, 3, 3, 0)], np.float32)
    found = fit_obstacles(points, np.array([0, 1, 0, 1, -1], np.int32), ROAD, BoxParams())
    assert [(o.cluster, o.closest_point[0], o.points) for o in found] == [(0, 20.0, 2), (1, 9.0, 2)]


def test_no_clusters_no_obstacles() -> None:
    assert fit_obstacles(np.zeros((3, 4), np.float32), np.full(3, -1, np.int32), ROAD, BoxParams()) == ()
