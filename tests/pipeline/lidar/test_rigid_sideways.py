"""Real swerves, and apparent ones: a footprint that grows while it is passed."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.lidar.track_history import rigid_sideways


def history(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(1, H, 5) sides over time, ten sightings per second."""
    t = np.arange(len(low)) * 0.1
    return np.stack([t, t * 0, (low + high) / 2, low, high], axis=1)[None]


STEPS = np.arange(10) * 0.1


@pytest.mark.parametrize(
    ("low", "high", "expected", "within"),
    [
        pytest.param(-4.0 + 2.0 * STEPS, -2.2 + 2.0 * STEPS, 2.0, 0.4, id="a car that pulls out at 2 m/s"),
        pytest.param(4.0 - 5.0 * STEPS, 5.8 - 5.0 * STEPS, -5.0, 0.4, id="one that crosses from the left"),
        pytest.param(-4.0 + 0.0 * STEPS, -3.6 + 2.0 * STEPS, 0.0, 0.0, id="a flank that comes into view"),
        pytest.param(-3.0 - 1.0 * STEPS, -3.0 + 1.0 * STEPS, 0.0, 0.0, id="one that grows to both sides"),
        pytest.param(-4.0 + 0.1 * STEPS, -2.2 + 0.1 * STEPS, 0.0, 0.0, id="no more than scatter explains"),
    ],
)
def test_a_swerve_takes_both_sides_along(low: np.ndarray, high: np.ndarray, expected: float, within: float) -> None:
    (found,) = rigid_sideways(history(low, high))
    assert found == pytest.approx(expected, abs=within)


def test_two_sightings_say_nothing_sure() -> None:
    seen_twice = np.full((1, 10, 5), np.nan)
    seen_twice[0, -2:] = history(np.array([-4.0, -3.9]), np.array([-2.2, -2.1]))[0]
    assert rigid_sideways(seen_twice).tolist() == [0.0]
    assert rigid_sideways(np.zeros((0, 10, 5))).tolist() == []
