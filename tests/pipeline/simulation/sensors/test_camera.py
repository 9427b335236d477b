"""The drawn camera: what it draws lies where the calibration says, at any place and in front of any near plane."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.alignment.projection import Pinhole
from pipeline.simulation.drawing.canvas import NEAR_M, clip_near
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors import camera
from pipeline.simulation.sensors.faults import Faults, most_turned_rad, true_camera
from pipeline.simulation.sensors.truth_boxes import in_image
from pipeline.simulation.world import world_state
from pipeline.simulation.world.roadside import Roadside
from pipeline.types import F64, U8, CameraCalibration
from tests.pipeline.simulation.worlds import with_actors


def draw(scene: Scenario, t_s: float = 0.0) -> tuple[U8, world_state.World]:
    roadside = Roadside.build(scene.road, scene.seed, 0.0, 600.0)
    now = world_state.at(scene, t_s)
    return camera.DrawnCamera(scene.road, roadside, scene.seed).image(now), now


TURNED = Faults(camera_yaw_deg=2.0, camera_pitch_deg=-1.0, camera_roll_deg=1.5)


def is_colour(image: U8, strong: tuple[int, ...], weak: tuple[int, ...], by: int) -> npt.NDArray[np.bool_]:
    """Pixels whose strong channels (0 blue, 1 green, 2 red) exceed the weak ones by more than ``by``."""
    signed = image.astype(int)
    return signed[..., list(strong)].min(axis=-1) > signed[..., list(weak)].max(axis=-1) + by


def pixels(points: F64) -> F64:
    model = camera.calibration()
    return Pinhole(model.K, model.distortion, model.T_camera_ego).project(points)


def test_the_calibration_is_a_78_degree_720p_camera() -> None:
    model = camera.calibration()
    diagonal = 2 * np.degrees(np.arctan(np.hypot(1280, 720) / 2 / model.K[0, 0]))
    assert diagonal == pytest.approx(78.0)
    straight_ahead = pixels(np.array([[1e6, 0.0, 0.8]]))[0]
    assert straight_ahead[0] == pytest.approx(640.0)
    assert straight_ahead[1] == pytest.approx(360.0 - model.K[1, 1] * np.tan(np.radians(2.0)), abs=0.1)


def test_a_turned_camera_sees_vehicles_where_its_own_mount_shows_them() -> None:
    red = "{id: 1, kind: car, lane: -2, ahead_m: 18, colour: '#ff1010', speed_mps: {0: 10}}"
    scene = with_actors(red)
    now, level = world_state.at(scene, 0.0), camera.calibration()
    actual = true_camera(level, TURNED)
    roadside = Roadside.build(scene.road, scene.seed, 0.0, 600.0)
    drawn = camera.DrawnCamera(scene.road, roadside, scene.seed, turns_rad=most_turned_rad(TURNED))

    def misses_px(calibrated: CameraCalibration) -> float:
        rows, columns = np.nonzero(is_colour(drawn.image(now, actual), (2,), (0, 1), 60))
        (seen,) = in_image(now, calibrated)
        return float(
            np.abs(np.subtract((columns.min(), rows.min(), columns.max(), rows.max()), seen.bbox))[[0, 2]].max()
        )

    assert misses_px(actual) < 6.0
    assert misses_px(level) > 20.0


@pytest.mark.parametrize("segments", ["{length_m: 2000}", "{length_m: 2000, curvature_per_m: 0.004}"])
def test_lane_lines_are_where_the_road_has_them(segments: str) -> None:
    scene = with_actors(segments=segments)
    image, now = draw(scene)
    edge_d = scene.road.edges_m()[0][0] + 0.25
    s = now.s_m + np.arange(12.0, 30.0, 2.0)
    for offset, bright in ((0.0, True), (0.7, False), (-0.7, False)):
        flat = now.to_ego(scene.road.to_world(s, edge_d + offset))
        uv = np.round(pixels(np.column_stack([flat, np.full(len(flat), -0.5)]))).astype(int)
        inside = (uv[:, 0] >= 0) & (uv[:, 0] < 1280) & (uv[:, 1] < 720)
        values = image[uv[inside, 1], uv[inside, 0]].mean(axis=1)
        assert np.count_nonzero(inside) >= 4
        assert np.all(values > 170) if bright else np.all(values < 150)


def test_a_car_is_drawn_inside_its_cuboids_outline() -> None:
    scene = with_actors("{id: 1, kind: car, lane: -2, colour: '#ff00ff', ahead_m: 15, speed_mps: {0: 20}}")
    image, now = draw(scene)
    without, _ = draw(with_actors())
    car = now.actors[0].cuboid
    uv = pixels(car.corners())
    differs = np.abs(image.astype(int) - without.astype(int)).sum(axis=2) > 60
    rows, columns = np.nonzero(differs)
    top, bottom, left, right = rows.min(), rows.max(), columns.min(), columns.max()
    assert top == pytest.approx(uv[:, 1].min(), abs=4)
    assert bottom == pytest.approx(uv[:, 1].max(), abs=12), "the shadow reaches a little further"
    assert left == pytest.approx(uv[:, 0].min(), abs=12)
    assert right == pytest.approx(uv[:, 0].max(), abs=12)
    magenta = is_colour(image, (0, 2), (1,), 80)
    assert np.mean(magenta[top:bottom, left:right]) > 0.35


def test_a_nearer_car_covers_a_farther_one() -> None:
    red = "{id: 1, kind: van, lane: -2, colour: '#ff0000', ahead_m: 10, speed_mps: {0: 20}}"
    green = "{id: 2, kind: car, lane: -2, colour: '#00ff00', ahead_m: 25, speed_mps: {0: 20}}"
    image, _ = draw(with_actors(f"{green}, {red}"))
    assert not np.any(is_colour(image, (1,), (0, 2), 120))
    alone, _ = draw(with_actors(green))
    assert np.any(is_colour(alone, (1,), (0, 2), 120))


def test_brake_lights_light_up() -> None:
    def reds(speeds: str) -> int:
        image, _ = draw(
            with_actors(f"{{id: 1, kind: car, lane: -2, colour: '#808080', ahead_m: 15, speed_mps: {speeds}}}")
        )
        return int(np.count_nonzero(is_colour(image, (2,), (1,), 130)))

    assert reds("{0: 20, 5: 10}") > reds("{0: 20}") + 50


@pytest.mark.parametrize("kind", ["car", "van", "truck", "bus", "motorcycle"])
@pytest.mark.parametrize(("ahead_m", "t_s"), [(-0.5, 1.0), (6.0, 0.0), (300.0, 0.0)], ids=["beside", "ahead", "far"])
def test_any_kind_beside_and_ahead_is_drawn(kind: str, ahead_m: float, t_s: float) -> None:
    """Beside the camera, a vehicle crosses the near plane; no part of it may be smeared over the sky."""
    scene = with_actors(
        f"{{id: 1, kind: {kind}, lane: -1, colour: '#ff00ff', ahead_m: {ahead_m}, speed_mps: {{0: 24}}}}"
    )
    image, _ = draw(scene, t_s)
    without, _ = draw(with_actors(), t_s)
    changed = np.any(image != without, axis=2)
    assert np.any(changed)
    assert not np.any(changed[:, 700:]), "it is on the left"


points = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-5, 5))


@settings(deadline=None)
@given(st.tuples(points, points, points))
def test_clipping_keeps_what_is_beyond_the_near_plane(corners: tuple[tuple[float, float, float], ...]) -> None:
    triangle = np.array(corners)
    kept = clip_near(triangle)
    beyond = triangle[:, 2] >= NEAR_M
    assert len(kept) == {0: 0, 1: 3, 2: 4, 3: 3}[int(beyond.sum())]
    if len(kept):
        assert kept[:, 2].min() >= NEAR_M - 1e-9
        for corner in triangle[beyond]:
            assert np.any(np.all(np.isclose(kept, corner), axis=1)), "corners beyond the plane stay"


TOWN = "{length_m: 2000}], lanes_forward: 1, lanes_oncoming: 1, median_m: 0, crossings: [{s_m: 125, lanes_each_way: 1}"


def test_a_crossing_road_is_painted_with_its_lines() -> None:
    """25 m ahead, there is asphalt instead of grass, gaps in our lines, and the crossing road's own lines."""
    crossed, now = draw(with_actors(segments=TOWN, lane=-1))
    plain, _ = draw(with_actors(segments=TOWN.replace("{s_m: 125, lanes_each_way: 1}", ""), lane=-1))

    def at(image: U8, x: float, s_y: float) -> npt.NDArray[np.int64]:
        u, v = np.round(pixels(np.array([[x, s_y - now.d_m, -0.5]]))[0]).astype(int)
        return image[v, u].astype(np.int64)

    right_edge = -3.6 + 0.25
    assert at(plain, 25.0, right_edge).min() > 170, "the edge line of a road without a crossing"
    assert at(crossed, 25.0, right_edge).max() < 150, "is open at the crossing"
    beside = at(plain, 25.0, -11.0), at(crossed, 25.0, -11.0)
    assert beside[0][1] > beside[0][2] + 10, "grass is green"
    assert abs(beside[1][1] - beside[1][2]) < 12, "asphalt is grey"
    assert at(crossed, 25.0 - 3.5 + 0.2, -14.0).min() > 150, "the crossing road's own edge line"
