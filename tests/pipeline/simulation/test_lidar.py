"""The ray-cast VLP-16: firing pattern, geometry against a plain reference, and how far it sees a car."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.simulation import lidar, world
from pipeline.simulation.roadside import Roadside

from .worlds import with_actors

NOTHING = Roadside((), np.empty(0), np.empty((0, 3)))


def sweep_of(actors: str, index: int = 0) -> lidar.Sweep:
    return lidar.sweep(world.at(with_actors(actors), 0.0), NOTHING, 1, index, 0)


def test_the_firing_pattern_is_a_vlp16s() -> None:
    rays = lidar.ray_directions()
    assert rays.shape == (904, 16, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=2), 1.0)
    elevation = np.degrees(np.arcsin(rays[..., 2]))
    np.testing.assert_allclose(elevation, np.broadcast_to(np.arange(-15, 16, 2), elevation.shape), atol=1e-9)
    azimuth = np.degrees(np.arctan2(rays[..., 1], rays[..., 0]))
    np.testing.assert_allclose(-np.diff(azimuth, axis=0), 0.199, atol=1e-3)  # clockwise, 600 rpm
    within = (azimuth[0, 0] - azimuth[0]) / 360.0 * 0.1 / 2.304e-6  # lasers fire 2.304 µs after one another
    np.testing.assert_allclose(within, [0, 2, 4, 6, 8, 10, 12, 14, 1, 3, 5, 7, 9, 11, 13, 15], atol=1e-6)


def test_an_empty_road_is_rings_on_the_ground() -> None:
    sweep = sweep_of("")
    assert np.abs(sweep.points[:, 2] + world.LIDAR_HEIGHT_M).max() < 0.02
    reach = np.hypot(sweep.points[:, 0], sweep.points[:, 1])
    for ring in range(7):
        expected = world.LIDAR_HEIGHT_M / np.tan(np.radians(15 - 2 * ring))
        assert np.median(reach[sweep.ring == ring]) == pytest.approx(expected, rel=0.01)
    assert sweep.ring.max() == 7, "what looks up meets nothing"
    assert sweep.points[:, 0].min() > -0.1, "the front half only"


boxes = st.tuples(
    st.floats(-20, 60), st.floats(-30, 30), st.floats(-0.5, 3),
    st.floats(0.1, 8), st.floats(0.1, 4), st.floats(0.1, 3), st.floats(-3.1, 3.1),
)  # fmt: skip


@settings(max_examples=40, deadline=None)
@given(st.lists(boxes, min_size=1, max_size=5))
def test_every_ray_ends_at_the_nearest_box(given_boxes: list[tuple[float, ...]]) -> None:
    """Against a reference that tries every ray with every box."""
    rows = np.array([[*box[:6], np.cos(box[6]), np.sin(box[6]), lidar.WALL] for box in given_boxes])
    rays = lidar.ray_directions()
    range_m, _ = lidar._cast(rays, rows, world.LIDAR_HEIGHT_M)
    flat = rays.reshape(-1, 3)
    with np.errstate(divide="ignore"):
        expected = np.where(flat[:, 2] < 0.0, -world.LIDAR_HEIGHT_M / flat[:, 2], np.inf)
    for x, y, z, half_l, half_w, half_h, c, s, _ in rows:
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        direction, start = flat @ turn, -np.array([x, y, z]) @ turn
        direction = np.where(np.abs(direction) < 1e-12, 1e-12, direction)
        ends = np.stack([(sign * np.array([half_l, half_w, half_h]) - start) / direction for sign in (-1.0, 1.0)])
        enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
        hit = (enter < leave) & (enter > 0.0)
        expected = np.where(hit & (enter < expected), enter, expected)
    differs = ~np.isclose(range_m.ravel(), expected, rtol=1e-9)
    assert np.count_nonzero(differs) <= 2, "apart from rays that graze an edge"


def points_on_car(gap_m: float, index: int) -> int:
    sweep = sweep_of(f"{{id: 1, kind: car, lane: -2, ahead_m: {gap_m}, speed_mps: {{0: 20}}}}", index)
    x, y, z = sweep.points[:, :3].T
    return int(np.count_nonzero((x > gap_m - 0.3) & (x < gap_m + 4.8) & (np.abs(y) < 1.1) & (z > -0.35)))


@pytest.mark.parametrize(
    ("low_m", "high_m", "least", "most"),
    [(10, 20, 0.95, 1.0), (20, 30, 0.75, 1.0), (30, 40, 0.2, 0.75), (55, 80, 0.0, 0.02)],
)
def test_a_car_fades_with_range_as_real_ones_do(low_m: float, high_m: float, least: float, most: float) -> None:
    """Real sweeps: five points or more in 96 % at 10–20 m, 90 % at 20–30 m, 46 % at 30–40 m, about none beyond 50 m."""
    seen = [points_on_car(gap, i) >= 5 for i, gap in enumerate(np.linspace(low_m, high_m, 40))]
    assert least <= np.mean(seen) <= most


def test_points_lie_on_the_cars_rear_face() -> None:
    sweep = sweep_of("{id: 1, kind: car, lane: -2, ahead_m: 12, speed_mps: {0: 20}}")
    x, y, z = sweep.points[:, :3].T
    rear = (np.abs(y) < 0.9) & (z > -0.2) & (z < 0.4) & (x > 5.0)
    assert np.count_nonzero(rear) > 20
    assert np.abs(x[rear] - 12.0).max() < 0.1


def test_what_stands_behind_a_car_is_hidden() -> None:
    near = "{id: 1, kind: truck, lane: -2, ahead_m: 10, speed_mps: {0: 20}}"
    far = "{id: 2, kind: car, lane: -2, ahead_m: 28, speed_mps: {0: 20}}"
    sweep = sweep_of(f"{near}, {far}")
    x, y, z = sweep.points[:, :3].T
    assert not np.any((x > 27.0) & (np.abs(y) < 0.8) & (z > -0.3))


def test_the_same_index_gives_the_same_noise() -> None:
    car = "{id: 1, kind: car, lane: -2, ahead_m: 12, speed_mps: {0: 20}}"
    assert sweep_of(car, 3).points.tobytes() == sweep_of(car, 3).points.tobytes()
    assert sweep_of(car, 3).points.tobytes() != sweep_of(car, 4).points.tobytes()
