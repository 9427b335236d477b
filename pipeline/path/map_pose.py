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
"""Fix-to-fix scatter as a share of the receiver's sigma (0.3 m for a sigma of 1.5 m; 2 mm for RTK with 1 cm)."""
WHITE_FLOOR_M = 0.03
COURSE_SIGMA_MPS = 0.1
"""Noise of the lateral speed from which a receiver computes its course: the course's sigma is this divided by the
speed."""
_START_HEADING_SIGMA_RAD = 0.1
_SMALLEST_JUMP_M = 0.6
"""A fix within this distance of the expected position is not a jump, however certain the filter is."""


class _Growth(NamedTuple):
    """Dead reckoning: speed error of 1 % plus 5 cm/s; heading a random walk of 0.003 rad in one second, which also
    covers ten seconds of the measured bias of 0.0005 rad/s."""

    speed_share: float = 0.01
    speed_mps: float = 0.05
    heading_rad_per_root_s: float = 0.003
    heading_without_yaw_rate: float = 0.05


GROWTH = _Growth()


@dataclass(frozen=True, eq=False)
class MapPose:
    """A Gaussian over position and heading on the map."""

    mean: F64
    """(3,) float64 east and north in metres, heading in radians counter-clockwise from east."""
    cov: F64
    """(3, 3) float64 covariance of ``mean``."""


def start(x: float, y: float, heading_rad: float, place_sigma_m: float) -> MapPose:
    """The pose at the first fix that has a course."""
    return MapPose(np.array([x, y, heading_rad]), np.diag([place_sigma_m**2] * 2 + [_START_HEADING_SIGMA_RAD**2]))


def white_sigma_m(sigma_m: float) -> float:
    """Fix-to-fix scatter of a receiver that reports ``sigma_m``."""
    return max(WHITE_FLOOR_M, WHITE_SHARE * sigma_m)


def predict(
    pose: MapPose, speed_mps: float, yaw_rate_radps: float | None, dt_s: float, coasting: Coasting | None = None
) -> MapPose:
    """The pose ``dt_s`` later by dead reckoning; a yaw rate that was never measured is 0 ± 0.05 rad/s. coasting:
    additional uncertainty if speed and yaw rate are no longer measured."""
    turn = GROWTH.heading_rad_per_root_s if yaw_rate_radps is not None else GROWTH.heading_without_yaw_rate
    along = (GROWTH.speed_share * speed_mps + GROWTH.speed_mps) * dt_s
    along_var, turn_var = along**2, turn**2 * dt_s
    if coasting is not None:
        along_var, turn_var = along_var + coasting.travelled_var_m2, turn_var + coasting.turned_var_rad2
    mean, cov = _predict(pose.mean, pose.cov, speed_mps, yaw_rate_radps or 0.0, dt_s, along_var, turn_var)
    return MapPose(mean, cov)


def jump_m(pose: MapPose, x: float, y: float, sigma_m: float, sigmas: float) -> float | None:
    """Distance of a fix from the expected position, if it is larger than noise explains (the innovation's Mahalanobis
    distance exceeds ``sigmas``); else None."""
    dx, dy = x - float(pose.mean[0]), y - float(pose.mean[1])
    a, b, d = float(pose.cov[0, 0]) + sigma_m**2, float(pose.cov[0, 1]), float(pose.cov[1, 1]) + sigma_m**2
    distance2 = (d * dx * dx - 2.0 * b * dx * dy + a * dy * dy) / (a * d - b * b)
    away = hypot(dx, dy)
    return away if distance2 > sigmas**2 and away > _SMALLEST_JUMP_M else None


def with_fix(pose: MapPose, x: float, y: float, sigma_m: float) -> MapPose:
    """The pose after a fix with standard deviation ``sigma_m`` on each axis."""
    mean, cov = _measure(pose.mean, pose.cov, 0, x, sigma_m**2)
    return MapPose(*_measure(mean, cov, 1, y, sigma_m**2))


def with_course(pose: MapPose, heading_rad: float, speed_mps: float) -> MapPose:
    """The pose after a course; a course more than 90° off belongs to a reversing car and is ignored."""
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
    """Update with a measurement of state i (Joseph form)."""
    gain = cov[:, i] / (cov[i, i] + var)
    keep = np.eye(3)
    for k in range(3):
        keep[k, i] -= gain[k]
    P = keep @ cov @ keep.T
    for a in range(3):
        for b in range(3):
            P[a, b] += var * (gain[a] * gain[b])
    return mean + gain * (value - mean[i]), 0.5 * (P + P.T)
