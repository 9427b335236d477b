"""The pose of the car on the map: a filter over fixes, courses, ego speed and yaw rate (extended Kalman, three states).

State [x, y, heading] in UTM metres and radians counter-clockwise from grid east. Its covariance is relative to the
receiver's own estimate of the world: a receiver's position is off by its ``sigma_m`` for minutes, while it scatters
little from fix to fix, so a jump shows at once. Measured on 60 s of a real drive (comma2k19, u-blox): 0.02 m sideways
from fix to fix with a reported sigma of metres, course 0.31° at 17 m/s, which is 0.09 m/s sideways.

Without a fix, the pose continues by speed and yaw rate (dead reckoning). Its errors grow as stated in ``_Growth``.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, isfinite, pi
from typing import NamedTuple

import numba
import numpy as np

from pipeline.common.geometry import F64
from pipeline.types import Coasting

WHITE_SHARE = 0.2
"""Scatter from fix to fix as a share of the receiver's sigma (0.3 m where it says 1.5 m; 2 mm where RTK says 1 cm)."""
WHITE_FLOOR_M = 0.03
COURSE_SIGMA_MPS = 0.1
"""Noise of the sideways speed from which a receiver takes its course: the course's sigma is this over the speed."""
_START_HEADING_SIGMA_RAD = 0.1
_SMALLEST_JUMP_M = 0.6
"""A fix no farther than this from where it was expected is no jump, however sure the filter is."""


class _Growth(NamedTuple):
    """Dead reckoning: speed off by a hundredth and 5 cm/s; heading a random walk of 0.003 rad in a second, which also
    covers ten seconds of the 0.0005 rad/s bias measured."""

    speed_share: float = 0.01
    speed_mps: float = 0.05
    heading_rad_per_root_s: float = 0.003
    heading_without_yaw_rate: float = 0.05


GROWTH = _Growth()


@dataclass(frozen=True, eq=False)
class MapPose:
    """A Gaussian over place and heading on the map."""

    mean: F64
    """(3,) float64 east and north in metres, heading in radians counter-clockwise from east."""
    cov: F64
    """(3, 3) float64 covariance of the same."""


def start(x: float, y: float, heading_rad: float, place_sigma_m: float) -> MapPose:
    """At the first fix that comes with a course."""
    return MapPose(np.array([x, y, heading_rad]), np.diag([place_sigma_m**2] * 2 + [_START_HEADING_SIGMA_RAD**2]))


def white_sigma_m(sigma_m: float) -> float:
    """Scatter from fix to fix of a receiver that reports ``sigma_m``."""
    return max(WHITE_FLOOR_M, WHITE_SHARE * sigma_m)


def predict(
    pose: MapPose, speed_mps: float, yaw_rate_radps: float | None, dt_s: float, coasting: Coasting | None = None
) -> MapPose:
    """The pose ``dt_s`` later by dead reckoning; a yaw rate that nobody ever measured is 0 ± 0.05 rad/s. coasting: what
    comes on top where speed and yaw rate are those of a while ago."""
    turn = GROWTH.heading_rad_per_root_s if yaw_rate_radps is not None else GROWTH.heading_without_yaw_rate
    along = (GROWTH.speed_share * speed_mps + GROWTH.speed_mps) * dt_s
    along_var, turn_var = along**2, turn**2 * dt_s
    if coasting is not None:
        along_var, turn_var = along_var + coasting.travelled_var_m2, turn_var + coasting.turned_var_rad2
    mean, cov = _predict(pose.mean, pose.cov, speed_mps, yaw_rate_radps or 0.0, dt_s, along_var, turn_var)
    return MapPose(mean, cov)


def jump_m(pose: MapPose, x: float, y: float, sigma_m: float, sigmas: float) -> float | None:
    """How far a fix lies from where it was expected, when that is farther than the noise explains (the innovation's
    Mahalanobis distance against ``sigmas``); None when it is where it should be."""
    dx, dy = x - float(pose.mean[0]), y - float(pose.mean[1])
    a, b, d = float(pose.cov[0, 0]) + sigma_m**2, float(pose.cov[0, 1]), float(pose.cov[1, 1]) + sigma_m**2
    distance2 = (d * dx * dx - 2.0 * b * dx * dy + a * dy * dy) / (a * d - b * b)
    away = hypot(dx, dy)
    return away if distance2 > sigmas**2 and away > _SMALLEST_JUMP_M else None


def with_fix(pose: MapPose, x: float, y: float, sigma_m: float) -> MapPose:
    """The pose after a fix that scatters by ``sigma_m`` each way."""
    mean, cov = _measure(pose.mean, pose.cov, 0, x, sigma_m**2)
    return MapPose(*_measure(mean, cov, 1, y, sigma_m**2))


def with_course(pose: MapPose, heading_rad: float, speed_mps: float) -> MapPose:
    """The pose after a course; one that lies more than 90° off is a car that reverses, and says nothing."""
    off = (heading_rad - float(pose.mean[2]) + pi) % (2 * pi) - pi
    if not isfinite(off) or abs(off) > pi / 2:
        return pose
    sigma = COURSE_SIGMA_MPS / max(speed_mps, COURSE_SIGMA_MPS)
    return MapPose(*_measure(pose.mean, pose.cov, 2, float(pose.mean[2]) + off, sigma * sigma))


@numba.njit(cache=True, nogil=True)
def _predict(mean, cov, speed, yaw_rate, dt, along_var, turn_var):  # type: ignore[no-untyped-def]  # pragma: no cover
    """F P Fᵀ + Q with the heading at the middle of the step."""
    middle = mean[2] + 0.5 * yaw_rate * dt
    c, s = np.cos(middle), np.sin(middle)
    way = speed * dt
    new = np.array([mean[0] + way * c, mean[1] + way * s, mean[2] + yaw_rate * dt])
    F = np.eye(3)
    F[0, 2], F[1, 2] = -way * s, way * c
    P = F @ cov @ F.T
    P[0, 0] += along_var * c * c
    P[1, 1] += along_var * s * s
    P[0, 1] += along_var * c * s
    P[1, 0] += along_var * c * s
    P[2, 2] += turn_var
    return new, P


@numba.njit(cache=True, nogil=True)
def _measure(mean, cov, i, value, var):  # type: ignore[no-untyped-def]  # pragma: no cover
    """State i measured (Joseph form)."""
    gain = cov[:, i] / (cov[i, i] + var)
    keep = np.eye(3)
    for k in range(3):
        keep[k, i] -= gain[k]
    P = keep @ cov @ keep.T
    for a in range(3):
        for b in range(3):
            P[a, b] += var * (gain[a] * gain[b])
    return mean + gain * (value - mean[i]), 0.5 * (P + P.T)
