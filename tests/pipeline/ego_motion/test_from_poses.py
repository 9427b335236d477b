"""Ego motion from recorded poses."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.geometry import rotation
from pipeline.ego_motion.from_poses import motion_along, motion_between
from pipeline.types import F64


def at(t_s: float, speed_mps: float, yaw_rate_radps: float) -> F64:
    """On the arc of a circle, from a heading of 2 rad, far from the map's origin."""
    T, heading = np.eye(4), 2.0 + yaw_rate_radps * t_s
    T[:3, :3] = rotation(0.0, 0.0, heading)
    if yaw_rate_radps:
        radius = speed_mps / yaw_rate_radps
        T[:2, 3] = 1e4 + radius * (np.sin(heading) - np.sin(2.0)), radius * (np.cos(2.0) - np.cos(heading))
    else:
        T[:2, 3] = 1e4 + speed_mps * t_s * np.cos(2.0), speed_mps * t_s * np.sin(2.0)
    return T


@pytest.mark.parametrize("rate_hz", [2.0, 10.0, 20.0])
@pytest.mark.parametrize(
    ("speed_mps", "yaw_rate_radps"), [(15.0, 0.0), (10.0, 0.3), (10.0, -0.3), (-2.0, 0.1), (0.0, 0.0)]
)
def test_speed_along_the_car_and_turning_to_the_left(rate_hz: float, speed_mps: float, yaw_rate_radps: float) -> None:
    times = [round(k / rate_hz * 1e9) for k in range(8)]
    found = motion_along(times, [at(t_ns / 1e9, speed_mps, yaw_rate_radps) for t_ns in times])
    assert [each.t_ns for each in found if each is not None] == times
    for each in found:
        assert each is not None
        assert each.speed_mps == pytest.approx(speed_mps, abs=0.005 * abs(speed_mps) + 1e-9)
        assert each.yaw_rate_radps == pytest.approx(yaw_rate_radps, abs=1e-6)
        assert each.source == "ins"


def test_one_pose_and_none_say_nothing() -> None:
    assert motion_along([5], [np.eye(4)]) == [None]
    assert motion_along([], []) == []
    assert motion_between([7, 7], [np.eye(4), np.eye(4)], 7) is None
