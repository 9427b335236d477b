"""Which structure constrains odometry."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.geometry import Cuboid
from pipeline.ego_motion import structure
from pipeline.types import LidarTrack, Obstacle, Sweep
from tests.pipeline.ego_motion.streets import ROAD, seen, street, tunnel


def test_road_own_body_and_vehicles_are_left_out() -> None:
    places = [(10.0, 0.0, -1.65), (1.0, 0.0, 0.0), (20.0, 0.0, -0.5), (20.0, 6.0, -0.5)]
    points = np.array([(*place, 0.0) for place in places], np.float32)
    sweep = Sweep(0, points, np.zeros(4, np.uint8), 16)
    car = Obstacle(0, Cuboid((22.0, 0.0, -1.0), (4.0, 1.8, 1.4), 0.0), (20.0, 0.0, -0.5), 9, 1.0, (1.0, 1.0, 1.0))
    track = LidarTrack(1, car, (-10.0, 0.0), 5, 0, False)
    assert structure.standing(sweep, ROAD, (), 0.0)[:, 1].tolist() == [0.0, 6.0]
    assert structure.standing(sweep, ROAD, (track,), 0.05)[:, 1].tolist() == [6.0], "and where it is by now"


def test_a_wall_fixes_only_its_normal_and_a_pole_both() -> None:
    walls = structure.support(seen(tunnel(), 0.0, 0.0, 0.0, 1).points[:, :3])
    assert walls.along_y > 50.0
    assert walls.along_x < 0.05 * walls.along_y
    poles = np.array([(x, y, z) for x in (10.0, 20.0) for y in (-5.0, 5.0) for z in (0.0, 0.5)], np.float32)
    assert structure.support(poles)[:2] == pytest.approx((4.0, 4.0))


def test_a_street_fixes_all_three() -> None:
    fixed = structure.support(seen(street(), 0.0, 0.0, 0.0, 1).points[:, :3])
    assert min(fixed.along_x, fixed.along_y) > 15.0
    assert fixed.turning_m2 > 15.0 * 10.0**2
