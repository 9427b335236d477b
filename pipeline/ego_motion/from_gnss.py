"""Ego speed and yaw rate from a GNSS receiver, which measures speed and course; the yaw rate is the change of
course."""

from __future__ import annotations

from math import ceil

import numpy as np

from pipeline.types import EgoState, GnssFix

_SPAN_NS, _LONGEST_NS = 600_000_000, 1_500_000_000
"""Course is noisy (0.2° of an RTK receiver): a line through 0.6 s of it halves the noise of two neighbours eight times,
and lags by 0.3 s, less than a car takes to turn in. Of a slower receiver it is the fewest fixes that span as much: two
that are a second apart are as quiet, and lag by 0.5 s. Further apart they say nothing about one turn."""
_SLOWEST_MPS = 3.0
"""Slower, the course says little about where the car points."""


Courses = tuple[tuple[int, float], ...]
"""(t_ns, course clockwise from north) of the last fixes, oldest first."""


def follow(courses: Courses, fix: GnssFix) -> tuple[Courses, EgoState]:
    """The courses to go on with, and own motion: speed as measured; the yaw rate (left positive) once there is course
    for it, else None."""
    if courses and not 0 < fix.t_ns - courses[-1][0] <= _LONGEST_NS:
        courses = ()
    courses = () if fix.course_rad is None or fix.speed_mps < _SLOWEST_MPS else (*courses, (fix.t_ns, fix.course_rad))
    while len(courses) > 1 and fix.t_ns - courses[1][0] >= _SPAN_NS:
        courses = courses[1:]
    return courses, EgoState(fix.t_ns, fix.speed_mps, _turning_left_radps(courses), source="gnss")


class MotionFromGnss:
    """Follows one receiver."""

    def __init__(self) -> None:
        self._courses: Courses = ()

    def push(self, fix: GnssFix) -> EgoState:
        """Own motion at the fix (``follow``)."""
        self._courses, ego = follow(self._courses, fix)
        return ego


def yaw_rate_lag_s(rate_hz: float) -> float | None:
    """By how much the yaw rate lags behind the car, of a receiver that sends so often; None where it is never known."""
    span_s = ceil(_SPAN_NS / 1e9 * rate_hz - 1e-3) / rate_hz
    return span_s / 2.0 if span_s <= _LONGEST_NS / 1e9 else None


def _turning_left_radps(courses: Courses) -> float | None:
    """Slope of the line through (t_ns, course clockwise from north), its sign turned; None where it is too short."""
    if not courses or courses[-1][0] - courses[0][0] < _SPAN_NS:
        return None
    t_s = np.array([(t - courses[0][0]) / 1e9 for t, _ in courses])
    course = np.unwrap([angle for _, angle in courses])
    return -float(np.polyfit(t_s, course, 1)[0])
