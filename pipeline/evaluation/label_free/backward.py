"""Estimates an object's earlier distances from later ranged measurements.

A Kalman filter of the distance and its rate runs backwards in time, with white acceleration noise. It starts once the
LiDAR has measured the object twice. Its uncertainty grows with the time before the last measurement, and estimates that
are too uncertain are not used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.types import F64

ACCEL_MPS2 = 1.5
"""Standard deviation of the acceleration between two vehicles on a road, as white noise."""
RANGE_SIGMA_M = 0.15
"""Standard deviation of a LiDAR distance to the nearest point of a moving vehicle: the point changes from sweep to
sweep."""
RATE_SIGMA_MPS = 15.0
"""Standard deviation of the rate before two measurements."""


class Looked(NamedTuple):
    """Estimates at earlier times from later measurements; NaN if unknown."""

    distance_m: F64
    """(N,) metres."""
    closing_mps: F64
    """(N,) m/s, positive while the gap shrinks."""
    sigma_m: F64
    """(N,) standard deviation of the distance."""
    closing_sigma_mps: F64
    """(N,) of the closing speed."""


def look_back(t_s: F64, ranged_m: F64) -> Looked:
    """The distance at each time, estimated from later measurements.

    Args:
        t_s: (N,) ascending times of the object's sightings, seconds.
        ranged_m: (N,) distance measured by the LiDAR at these times, metres; NaN without one.
    """
    count = len(t_s)
    looked = Looked(*(np.full(count, np.nan) for _ in range(4)))
    state = covariance = None
    measured = 0
    for at in range(count - 1, -1, -1):
        if state is not None and covariance is not None:
            dt = float(t_s[at + 1] - t_s[at])
            step = np.array(
                [[1.0, dt], [0.0, 1.0]]
            )  # the rate is the closing speed: backwards in time, the distance grows by it
            noise = ACCEL_MPS2**2 * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
            state, covariance = step @ state, step @ covariance @ step.T + noise
            if measured > 1:
                looked.distance_m[at], looked.closing_mps[at] = state
                looked.sigma_m[at] = np.sqrt(covariance[0, 0])
                looked.closing_sigma_mps[at] = np.sqrt(covariance[1, 1])
        if np.isfinite(ranged_m[at]):
            measured += 1
            if state is None or covariance is None:
                state = np.array([ranged_m[at], 0.0])
                covariance = np.diag([RANGE_SIGMA_M**2, RATE_SIGMA_MPS**2])
                continue
            gain = covariance[:, 0] / (covariance[0, 0] + RANGE_SIGMA_M**2)
            state = state + gain * (ranged_m[at] - state[0])
            covariance = covariance - np.outer(gain, covariance[0])
    return looked
