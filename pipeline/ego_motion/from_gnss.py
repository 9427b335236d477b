"""Ego speed and yaw rate from a GNSS receiver, which measures speed and course; the yaw rate is the change of
course."""

from __future__ import annotations

from math import ceil, tau

from pipeline.types import EgoState, GnssFix

_SPAN_NS, _LONGEST_NS = 600_000_000, 1_500_000_000
"""The course is noisy (0.2° with an RTK receiver). Compared with the difference of two neighbours, a line fit over 0.6
s reduces the noise by a factor of eight, and its lag of 0.3 s is shorter than a car takes to enter a turn. For slower
receivers, the fewest fixes that span this time are used: two fixes one second apart are as quiet, and lag by 0.5 s.
Fixes farther apart do not show a single turn."""
_SLOWEST_MPS = 3.0
"""Below this speed, the course says little about the car's heading."""


Courses = tuple[tuple[int, float], ...]
"""(t_ns, course clockwise from north) of the last fixes, oldest first."""


def follow(courses: Courses, fix: GnssFix) -> tuple[Courses, EgoState]:
    """The courses for the next call, and own motion: speed as measured; the yaw rate (left positive) once there are
    enough courses, else None."""
    if courses and not 0 < fix.t_ns - courses[-1][0] <= _LONGEST_NS:
        courses = ()
    courses = () if fix.course_rad is None or fix.speed_mps < _SLOWEST_MPS else (*courses, (fix.t_ns, fix.course_rad))
    while len(courses) > 1 and fix.t_ns - courses[1][0] >= _SPAN_NS:
        courses = courses[1:]
    return courses, EgoState(fix.t_ns, fix.speed_mps, _turning_left_radps(courses), source="gnss")


class MotionFromGnss:
    """Own motion from one receiver."""

    def __init__(self) -> None:
        self._courses: Courses = ()

    def push(self, fix: GnssFix) -> EgoState:
        """Own motion at the fix (``follow``)."""
        self._courses, ego = follow(self._courses, fix)
        return ego


def yaw_rate_lag_s(rate_hz: float) -> float | None:
    """Lag of the yaw rate behind the car, for a receiver with this rate; None if the yaw rate is never known."""
    span_s = ceil(_SPAN_NS / 1e9 * rate_hz - 1e-3) / rate_hz
    return span_s / 2.0 if span_s <= _LONGEST_NS / 1e9 else None


def _turning_left_radps(courses: Courses) -> float | None:
    """Slope of the line through (t_ns, course clockwise from north), with inverted sign; None if the span is too
    short."""
    if not courses or courses[-1][0] - courses[0][0] < _SPAN_NS:
        return None
    t_s, course = [(t - courses[0][0]) / 1e9 for t, _ in courses], [courses[0][1]]
    for _, angle in courses[1:]:
        course.append(angle + tau * round((course[-1] - angle) / tau))  # the turn that is nearest to the last course
    mean_s, mean = sum(t_s) / len(t_s), sum(course) / len(course)
    slope = sum((t - mean_s) * (angle - mean) for t, angle in zip(t_s, course, strict=True))
    return -slope / sum((t - mean_s) ** 2 for t in t_s)
