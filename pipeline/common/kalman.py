"""Constant-velocity Kalman filter in the plane, as pure functions: state in, state out.

State x = [x, y, vx, vy] (m, m/s) in the ego frame of the moment; velocities are whatever the measured positions move
with (relative to ego where the positions are). Both trackers use it, with a noise of their own each.

Every function also takes many states at once, as leading dimensions: mean (T, 4), cov (T, 4, 4), positions (T, 2).

Model: Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation* (2001), section 6.3.2,
piecewise constant white acceleration: an acceleration of standard deviation ``accel_sigma`` that holds for one step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]


class CvState(NamedTuple):
    """State of a constant-velocity filter; leading axes are independent filters."""

    mean: F64
    """(…, 4) float64 ``x y vx vy`` in m and m/s."""
    cov: F64
    """(…, 4, 4) float64, symmetric, positive semi-definite."""


class Transition(NamedTuple):
    """A linear change of the state x → F x + b."""

    matrix: F64
    """(4, 4) float64 F."""
    offset: F64
    """(4,) float64 b."""


def start(position: npt.ArrayLike, R: F64, speed_sigma: float) -> CvState:
    """State of a new track: the measured position, with velocity 0 ± ``speed_sigma`` m/s along each axis.

    position: (…, 2) m. R: (2, 2) covariance of the measured position, m².
    """
    z = np.asarray(position, dtype=np.float64)
    cov = np.zeros((*z.shape[:-1], 4, 4))
    cov[..., :2, :2] = R
    cov[..., 2, 2] = cov[..., 3, 3] = speed_sigma**2
    return CvState(np.concatenate([z, np.zeros_like(z)], axis=-1), cov)


def stacked(states: Sequence[CvState]) -> CvState:
    """Single filters as one state of many: mean (T, 4), cov (T, 4, 4)."""
    mean, cov = [each.mean for each in states], [each.cov for each in states]
    return CvState(np.array(mean).reshape(-1, 4), np.array(cov).reshape(-1, 4, 4))


def unstacked(state: CvState) -> list[CvState]:
    """The single filters of a state of many, as views."""
    return list(map(CvState, state.mean, state.cov))


def predict(state: CvState, dt_s: float, accel_sigma: npt.ArrayLike, transition: Transition | None = None) -> CvState:
    """The state ``dt_s`` ≥ 0 seconds later. ``accel_sigma``: m/s², along each axis; for all filters, or (…) for
    each. transition: what the state becomes in that time; None for constant velocity. ValueError for a negative dt."""
    if dt_s < 0.0:
        raise ValueError(f"a filter cannot run back in time: dt = {dt_s} s")
    F, b = transition if transition is not None else _constant_velocity(dt_s)
    mean, cov = state.mean.reshape(-1, 4), state.cov.reshape(-1, 4, 4)
    accel_var = np.zeros(len(mean)) + np.square(accel_sigma)
    mean, cov = _predict(mean, cov, F, b, dt_s, accel_var)
    return CvState(mean.reshape(state.mean.shape), cov.reshape(state.cov.shape))


def _constant_velocity(dt_s: float) -> Transition:
    F = np.eye(4)
    F[0, 2] = F[1, 3] = dt_s
    return Transition(F, np.zeros(4))


def update(state: CvState, z: npt.ArrayLike, R: F64) -> CvState:
    """The state updated by a measured position ``z`` (…, 2) m with covariance ``R`` m² (Joseph form): (2, 2) for all
    filters, or (…, 2, 2) for each."""
    z = np.asarray(z, dtype=np.float64).reshape(-1, 2)
    noise = np.zeros((len(z), 2, 2)) + R
    mean, cov = _update(state.mean.reshape(-1, 4), state.cov.reshape(-1, 4, 4), z, noise)
    return CvState(mean.reshape(state.mean.shape), cov.reshape(state.cov.shape))


@numba.njit(cache=True, nogil=True)
def _predict(mean, cov, F, b, dt, accel_var):  # type: ignore[no-untyped-def]  # pragma: no cover
    """F x + b and F P Fᵀ + Q, with loops written out: BLAS is slower for 4 × 4."""
    new_mean, new_cov = np.empty_like(mean), np.empty_like(cov)
    half = np.empty((4, 4))
    for t in range(len(mean)):
        for i in range(4):
            new_mean[t, i] = b[i]
            for k in range(4):
                new_mean[t, i] += F[i, k] * mean[t, k]
            for j in range(4):
                half[i, j] = 0.0
                for k in range(4):
                    half[i, j] += F[i, k] * cov[t, k, j]
        for i in range(4):
            for j in range(i + 1):
                total = 0.0
                for k in range(4):
                    total += half[i, k] * F[j, k]
                new_cov[t, i, j] = new_cov[t, j, i] = total
        for i in range(2):
            new_cov[t, i, i] += accel_var[t] * dt**4 / 4
            new_cov[t, i, i + 2] += accel_var[t] * dt**3 / 2
            new_cov[t, i + 2, i] += accel_var[t] * dt**3 / 2
            new_cov[t, i + 2, i + 2] += accel_var[t] * dt**2
    return new_mean, new_cov


@numba.njit(cache=True, nogil=True)
def _update(mean, cov, z, R):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Joseph form: stays symmetric and positive semi-definite despite rounding of the gains."""
    new_mean, new_cov = np.empty_like(mean), np.empty_like(cov)
    keep = np.empty((4, 4))
    for t in range(len(mean)):
        a, b = cov[t, 0, 0] + R[t, 0, 0], cov[t, 0, 1] + R[t, 0, 1]
        c, d = cov[t, 1, 0] + R[t, 1, 0], cov[t, 1, 1] + R[t, 1, 1]
        det = a * d - b * c
        gain = np.empty((4, 2))
        for i in range(4):
            gain[i, 0] = (cov[t, i, 0] * d - cov[t, i, 1] * c) / det
            gain[i, 1] = (cov[t, i, 1] * a - cov[t, i, 0] * b) / det
        for i in range(4):
            new_mean[t, i] = mean[t, i] + gain[i, 0] * (z[t, 0] - mean[t, 0]) + gain[i, 1] * (z[t, 1] - mean[t, 1])
            for j in range(4):
                keep[i, j] = (1.0 if i == j else 0.0) - (gain[i, j] if j < 2 else 0.0)
        joseph = keep @ cov[t] @ keep.T + gain @ R[t] @ gain.T
        for i in range(4):
            for j in range(4):
                new_cov[t, i, j] = (joseph[i, j] + joseph[j, i]) / 2
    return new_mean, new_cov


def mahalanobis2(state: CvState, z: npt.ArrayLike, R: F64) -> float:
    """Squared distance of one measured position from the expected one, in standard deviations: χ² with 2 degrees of
    freedom when the model holds (9.21 is its 99 % point)."""
    (a, b), (c, d) = (state.cov[:2, :2] + R).tolist()
    dx, dy = (np.asarray(z, dtype=np.float64) - state.mean[:2]).tolist()
    return float((d * dx * dx - (b + c) * dx * dy + a * dy * dy) / (a * d - b * c))
