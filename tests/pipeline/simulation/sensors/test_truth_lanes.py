"""Given lane lines and the planned route lie where the road is."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.alignment.projection import Pinhole
from pipeline.path.route_line import lay_out, to_grid
from pipeline.simulation import scenario
from pipeline.simulation.sensors import gnss
from pipeline.simulation.sensors.camera import calibration
from pipeline.simulation.sensors.detection_model import LineNoise
from pipeline.simulation.sensors.planned_route import planned_route
from pipeline.simulation.sensors.truth_lanes import lane_points
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import LIDAR_HEIGHT_M
from tests.pipeline.simulation.worlds import with_actors


@pytest.mark.parametrize("segments", ["{length_m: 2000}", "{length_m: 2000, radius_m: 125}"], ids=["straight", "bend"])
def test_the_points_lie_on_the_roads_lines(segments: str) -> None:
    """Projected onto the road, near points are on a line; three lanes have four lines."""
    scene = with_actors(segments=segments)
    camera, now = calibration(scene.camera), world_state.at(scene, 1.0)
    raw = lane_points(now, scene.road, camera, LineNoise(), 1, 10)
    assert set(raw.line.tolist()) == {0, 1, 2, 3}
    eye, ray = Pinhole(camera.K, camera.distortion, camera.T_camera_ego).rays(raw.points.astype(np.float64))
    on_road = eye + ray * ((-LIDAR_HEIGHT_M - eye[2]) / ray[:, 2])[:, None]
    along = now.s_m + np.arange(0.0, 80.0, 0.25)
    right = scene.road.edges_m()[0][0]
    for number in range(4):
        line = now.to_ego(scene.road.to_world(along, right + number * scene.road.lane_width_m))
        mine = on_road[(raw.line == number) & (np.hypot(*on_road[:, :2].T) < 30.0), :2]
        assert len(mine) > 5
        assert max(np.hypot(*(line - point).T).min() for point in mine) < 0.35


def test_the_same_moment_gives_the_same_points_and_another_others() -> None:
    scene = with_actors()
    now, camera = world_state.at(scene, 0.0), calibration(scene.camera)
    first, again, other = (lane_points(now, scene.road, camera, LineNoise(), 1, index).points for index in (0, 0, 1))
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:50], other[:50])


@pytest.mark.parametrize("name", ["left_turn", "cut_in", "curve_500"])
def test_the_planned_route_is_the_way_driven(name: str) -> None:
    """Every fix of the drive lies on it, within the receiver's noise."""
    scene = scenario.load(name)
    route = planned_route(scene)
    line = lay_out(route)
    assert line is not None
    for t_s in np.linspace(0.0, scene.duration_s, 12).tolist():
        fix = gnss.fix(world_state.at(scene, t_s), scene.gnss, 1, round(10 * t_s), 0)
        x, y, _ = to_grid(line.epsg, fix.lat_deg, fix.lon_deg)
        assert np.hypot(*(line.places - (x, y)).T).min() < 0.6, "half a step along, centimetres aside"
    ends = world_state.at(scene, scene.duration_s)
    x, y, _ = to_grid(line.epsg, fix.lat_deg, fix.lon_deg)
    nearest = int(np.argmin(np.hypot(*(line.places - (x, y)).T)))
    assert len(line.places) - nearest > 300, "and it goes on beyond the end"
    assert ends.speed_mps >= 0.0
