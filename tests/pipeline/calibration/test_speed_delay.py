"""A late own speed is found while the car accelerates and brakes, and nothing is said at one speed."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.calibration.speed_delay import NoDelay, SpeedPair, forward_m, speed_delay
from pipeline.common.geometry import rotation


def pairs(late_ms: float, accel: float = 1.5, seconds: float = 40.0, noise_m: float = 0.02) -> list[SpeedPair]:
    """An oscillating speed, measured by odometry whose positions have errors of some centimetres."""
    rng, t_s = np.random.default_rng(5), np.arange(0.0, seconds, 0.1)

    def speed(at: np.ndarray) -> np.ndarray:
        return 12.0 + 4.0 * accel * np.sin(at / 4.0) / 1.5

    places = np.cumsum(speed(t_s + 0.05) * 0.1) + rng.normal(0.0, noise_m, len(t_s))
    lidar = np.diff(places) / 0.1
    seen = speed(t_s[1:] - late_ms / 1e3) / 0.98 + rng.normal(0.0, 0.03, len(lidar))
    # place k is that at t + 0.1, so the displacement k → k + 1 is centred at t[k + 1] + 0.05
    return [
        SpeedPair(round((t + 0.05) * 1e9), float(a), float(b), round(t * 1e9))
        for t, a, b in zip(t_s[1:], lidar, seen, strict=True)
    ]


@pytest.mark.parametrize("late_ms", [0.0, 120.0, 300.0, -80.0])
def test_a_late_speed_is_found(late_ms: float):
    found = speed_delay(pairs(late_ms))
    assert found.ego_offset_ms == pytest.approx(-late_ms, abs=25.0)
    assert abs(found.ego_offset_ms + late_ms) < 4.0 * found.sigma_ms
    assert found.scale == pytest.approx(0.98, abs=0.01)


def test_one_speed_and_a_short_drive_tell_nothing():
    with pytest.raises(NoDelay, match="accelerate and brake"):
        speed_delay(pairs(100.0, accel=0.0))
    with pytest.raises(NoDelay, match="too short"):
        speed_delay(pairs(100.0, seconds=4.5))
    with pytest.raises(NoDelay, match="too few"):
        speed_delay([])


def test_the_way_forward_is_along_the_middle_of_the_turn():
    before, after = np.eye(4), np.eye(4)
    after[:3, :3] = rotation(0.0, 0.0, 0.2)
    after[:3, 3] = 2.0 * np.cos(0.1), 2.0 * np.sin(0.1), 0.0
    assert forward_m(before, after) == pytest.approx(2.0)
