"""The ray-cast VLP-16: firing pattern, geometry against a plain reference, and how far it sees a car."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.lidar import rays as lidar_rays
from pipeline.simulation.sensors.lidar.model import LidarModel
from pipeline.simulation.sensors.lidar.scene import PAINT, WALL
from pipeline.simulation.sensors.lidar.sensor import Lidar
from pipeline.simulation.world import world_state
from pipeline.simulation.world.roadside import Roadside
from pipeline.types import F64, Sweep
from tests.pipeline.simulation.worlds import with_actors

NOTHING = Roadside((), np.empty(0), np.empty((0, 3)))


def sweep_of(actors: str, index: int = 0, **model: object) -> Sweep:
    now = world_state.at(with_actors(actors), 0.0)
    return Lidar(LidarModel.model_validate(model)).sweep(now, NOTHING, 1, index, 0)


def test_the_firing_pattern_is_a_vlp16s() -> None:
    rays = lidar_rays.directions()
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
    assert np.abs(sweep.points[:, 2] + world_state.LIDAR_HEIGHT_M).max() < 0.02
    reach = np.hypot(sweep.points[:, 0], sweep.points[:, 1])
    for ring in range(7):
        expected = world_state.LIDAR_HEIGHT_M / np.tan(np.radians(15 - 2 * ring))
        assert np.median(reach[sweep.ring == ring]) == pytest.approx(expected, rel=0.01)
    assert sweep.ring.max() == 7, "what looks up meets nothing"
    assert sweep.points[:, 0].min() > -0.1, "the front half only"


@pytest.mark.parametrize("radius_m", [-600.0, 600.0, 2000.0])
def test_over_crests_and_in_sags_rings_lie_on_the_curved_road(radius_m: float) -> None:
    """radius_m: positive on a crest, beyond which the flattest ring does not meet the road."""
    now = replace(world_state.at(with_actors(""), 0.0), hump_per_m=1.0 / radius_m)
    sweep = Lidar(LidarModel(range_sigma_m=0.0)).sweep(now, NOTHING, 1, 0, 0)
    x, y, z = sweep.points[:, :3].T
    np.testing.assert_allclose(z, -world_state.LIDAR_HEIGHT_M - x * x / radius_m / 2.0, atol=0.05)
    assert (7 in sweep.ring[np.abs(y) < 0.2 * x]) == (radius_m < 0.0)


boxes = st.tuples(
    st.floats(-20, 60), st.floats(-30, 30), st.floats(-0.5, 3),
    st.floats(0.1, 8), st.floats(0.1, 4), st.floats(0.1, 3), st.floats(-3.1, 3.1),
)  # fmt: skip


@settings(max_examples=40, deadline=None)
@given(st.lists(boxes, min_size=1, max_size=5))
def test_every_ray_ends_at_the_nearest_box(given_boxes: list[tuple[float, ...]]) -> None:
    """Compared with a reference that tests every ray against every box."""
    rows = np.array([[*box[:6], np.cos(box[6]), np.sin(box[6]), WALL, 0, 0, 0, 1] for box in given_boxes])
    rays = lidar_rays.directions()
    ground = np.array([-world_state.LIDAR_HEIGHT_M, 0.0, 0.0, 0.0])
    range_m, _, _ = lidar_rays.cast(rays, np.zeros(len(rays)), rows, ground, 0)
    flat = rays.reshape(-1, 3)
    with np.errstate(divide="ignore"):
        expected = np.where(flat[:, 2] < 0.0, -world_state.LIDAR_HEIGHT_M / flat[:, 2], np.inf)
    for x, y, z, half_l, half_w, half_h, c, s in rows[:, :8]:
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


# ---------------------------------------------------------------- while the head turns


def cloud_of(scene: Scenario, t_s: float = 0.0, **model: object) -> F64:
    sensor = Lidar(LidarModel.model_validate({"range_sigma_m": 0.0, "dropout": 0.0, **model}))
    return sensor.sweep(world_state.at(scene, t_s), NOTHING, 1, 0, 0).points[:, :3].astype(np.float64)


def rear_x(points: F64, y_m: float) -> float:
    """x of the rear of the object at about y."""
    near = points[(np.abs(points[:, 1] - y_m) < 0.8) & (points[:, 2] > -0.2) & (points[:, 0] > 3.0)]
    return float(np.percentile(near[:, 0], 5))


@pytest.mark.parametrize(("lane", "side"), [(-1, 1.0), (-2, 0.0), (-3, -1.0)])
def test_what_stands_is_met_earlier_on_the_left_and_later_on_the_right(lane: int, side: float) -> None:
    """Passing a standing car 12 m ahead at 30 m/s: left of the axis, it is measured before the tick and farther away;
    right of it, after the tick and nearer. 3.6 m to the side at 12 m is 16.7°, or 4.6 ms of the head's rotation."""
    parked = with_actors(f"{{id: 1, kind: van, lane: {lane}, ahead_m: 12, speed_mps: {{0: 0}}}}", speed=30.0)
    moved = rear_x(cloud_of(parked), 3.6 * side) - rear_x(cloud_of(parked, motion=False), 3.6 * side)
    assert moved == pytest.approx(side * 30.0 * np.degrees(np.arctan2(3.6, 12.0)) / 3600.0, abs=0.04)


def test_what_drives_along_is_not_distorted() -> None:
    beside = with_actors("{id: 1, kind: van, lane: -1, ahead_m: 12, speed_mps: {0: 30}}", speed=30.0)
    np.testing.assert_allclose(cloud_of(beside), cloud_of(beside, motion=False))


def test_moving_boxes_are_met_where_they_are_at_each_rays_time() -> None:
    """Compared with casting the same rays after every box was placed at its position when that column fires."""
    rays, times = lidar_rays.directions(), lidar_rays.firing_times_s().mean(axis=1)
    ground = np.array([-0.5, 0.0, 0.0, 0.0])
    box = np.array([18.0, 3.0, 0.5, 2.0, 1.0, 0.9, np.cos(0.4), np.sin(0.4), WALL, -25.0, 6.0, 0.5, 1.0])
    moving, _, _ = lidar_rays.cast(rays, times, box[None], ground, 0)
    still = np.zeros(len(times))
    for column in range(0, len(times), 7):
        here = box.copy()
        here[:2] += box[9:11] * times[column]
        here[6:8] = np.cos(0.4 + 0.5 * times[column]), np.sin(0.4 + 0.5 * times[column])
        placed, _, _ = lidar_rays.cast(rays, still, here[None], ground, 0)
        np.testing.assert_allclose(moving[column], placed[column], atol=2e-3)


# ---------------------------------------------------------------- what comes back


def count(colour: str = "#8090a0", ahead_m: float = 24.0, **model: object) -> int:
    car = f"{{id: 1, kind: van, lane: -2, colour: '{colour}', ahead_m: {ahead_m}, speed_mps: {{0: 20}}}}"
    sensor = Lidar(LidarModel.model_validate(model))
    sweeps = [sensor.sweep(world_state.at(with_actors(car), 0.0), NOTHING, 1, i, 0).points for i in range(20)]
    x, y, z = np.concatenate(sweeps)[:, :3].T
    return int(np.count_nonzero((x > ahead_m - 0.5) & (np.abs(y) < 1.1) & (z > -0.2)))


def test_dark_paint_returns_less() -> None:
    assert count("#101010", 30.0) < 0.7 * count("#f4f4f4", 30.0)


def test_drop_outs_are_as_many_as_said() -> None:
    assert count(dropout=0.4) == pytest.approx(0.6 * count(dropout=0.0), rel=0.1)
    assert count(dropout=1.0) == 0


def test_a_side_met_at_a_grazing_angle_returns_less_than_a_rear() -> None:
    """Share of returns of rays that end on a wall along the road and on one across it, at the same range."""
    rows = np.array([[24.0, 0.0, 0.4, 0.1, 30.0, 0.9, 1.0, 0.0, PAINT, 0, 0, 0, 1.0]])  # a wall across
    flat = np.array([[24.0, 3.0, 0.4, 30.0, 0.1, 0.9, 1.0, 0.0, PAINT, 0, 0, 0, 1.0]])  # a wall along

    def share(boxes: F64) -> float:
        sensor, ground = Lidar(), np.array([-5.0, 0.0, 0.0, 0.0])
        ends, met, _ = lidar_rays.cast(lidar_rays.directions(), np.zeros(lidar_rays.COLUMNS), boxes, ground, 0)
        away = (met == 0) & (ends > 22.0) & (ends < 27.0)
        got = sensor.sweep_of(boxes, ground, np.random.default_rng(1), 0).points
        back = np.hypot(np.hypot(got[:, 0], got[:, 1]), got[:, 2])
        on = (back > 22.0) & (back < 27.0) & (got[:, 2] > -0.6)
        return float(np.count_nonzero(on) / np.count_nonzero(away))

    assert share(rows) > 0.7
    assert share(flat) < 0.3 * share(rows)


def test_a_tilted_sensor_sees_the_same_world() -> None:
    """The points of a pitched and rolled sensor lie on the same road and rear as those of a level one."""
    scene = with_actors("{id: 1, kind: truck, lane: -2, ahead_m: 14, speed_mps: {0: 20}}")
    tilted = cloud_of(scene, up_m=0.4, pitch_deg=3.0, roll_deg=-2.0, yaw_deg=4.0)
    low = tilted[tilted[:, 2] < -0.4]
    assert np.abs(low[:, 2] + world_state.LIDAR_HEIGHT_M).max() < 0.06
    assert rear_x(tilted, 0.0) == pytest.approx(14.0, abs=0.1)
    assert len(tilted) > 0.5 * len(cloud_of(scene))
