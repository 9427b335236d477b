"""Own motion from a receiver: signs in words, noise, and when nothing is said."""

from __future__ import annotations

from math import ceil

import numpy as np
import pytest

from pipeline.ego_motion.from_gnss import MotionFromGnss, yaw_rate_lag_s
from pipeline.types import EgoState, GnssFix

SECOND = 1_000_000_000


def drive(courses_rad: list[float | None], speed_mps: float = 20.0, step_s: float = 0.1) -> list[EgoState]:
    motion = MotionFromGnss()
    return [
        motion.push(GnssFix(round(k * step_s * SECOND), 48.0, 11.0, 500.0, course, speed_mps, "rtk_fixed", 0.01))
        for k, course in enumerate(courses_rad)
    ]


def test_a_car_that_turns_left_has_a_positive_yaw_rate() -> None:
    """The course is clockwise from north: turning left it falls."""
    last = drive([1.0 - 0.02 * k for k in range(10)])[-1]
    assert last.yaw_rate_radps == pytest.approx(0.2)


def test_passing_north_is_no_turn() -> None:
    last = drive([(0.05 - 0.02 * k) % (2 * np.pi) for k in range(10)])[-1]
    assert last.yaw_rate_radps == pytest.approx(0.2)


def test_noise_of_a_receiver_is_smoothed() -> None:
    noise = np.random.default_rng(3).normal(0.0, np.radians(0.2), 400)
    rates = [state.yaw_rate_radps for state in drive(list(noise))[10:]]
    assert np.std([rate for rate in rates if rate is not None]) < 0.01, "two neighbours alone would give 0.05 rad/s"


@pytest.mark.parametrize("rate_hz", [1.0, 2.0, 4.0, 5.0, 10.0, 20.0])
def test_a_turn_is_known_at_every_usual_rate_as_late_as_said(rate_hz: float) -> None:
    """Course during a turn that tightens steadily: the slope of the line is the yaw rate at its middle."""
    courses = [-0.05 * (k / rate_hz) ** 2 for k in range(round(3 * rate_hz) + 1)]
    known = [state.yaw_rate_radps for state in drive(list(courses), step_s=1.0 / rate_hz)]
    lag_s = yaw_rate_lag_s(rate_hz)
    assert lag_s is not None
    assert lag_s <= 0.5
    assert known[-1] == pytest.approx(0.1 * (3.0 - lag_s))
    assert None not in known[ceil(2 * lag_s * rate_hz) :]


def test_a_receiver_too_slow_for_a_yaw_rate_says_so() -> None:
    assert yaw_rate_lag_s(0.5) is None


@pytest.mark.parametrize(
    ("case", "courses", "speed_mps", "step_s"),
    [
        ("too few", [1.0, 1.0, 1.0], 20.0, 0.1),
        ("too slow", [1.0] * 10, 1.0, 0.1),
        ("no course", [None] * 10, 20.0, 0.1),
        ("once in two seconds", [1.0] * 10, 20.0, 2.0),
    ],
)
def test_what_cannot_be_known_is_null(case: str, courses: list[float | None], speed_mps: float, step_s: float) -> None:
    last = drive(courses, speed_mps, step_s)[-1]
    assert last.yaw_rate_radps is None
    assert last.speed_mps == speed_mps
