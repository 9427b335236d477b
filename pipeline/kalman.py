"""Constant-velocity Kalman filter in the plane, as pure functions: state in, state out.

State x = [x, y, vx, vy] (m, m/s) in the ego frame of the moment; velocities are whatever the measured positions move
with (relative to ego where the positions are). Both trackers use it, with a noise of their own each.

Every function also takes many states at once, as leading dimensions: mean (T, 4), cov (T, 4, 4), positions (T, 2).

Model: Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation* (2001), section 6.3.2,
piecewise constant white acceleration: an acceleration of standard deviation ``accel_sigma`` that holds for one step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]

_H = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class CvState:
    """mean: (…, 4) float64 ``x y vx vy`` in m and m/s. cov: (…, 4, 4) float64, symmetric, positive semi-definite."""

    mean: F64
    cov: F64


def start(position: npt.ArrayLike, R: F64, speed_sigma: float) -> CvState:
    """A track at its first sighting: the place as measured, the velocity 0 ± ``speed_sigma`` m/s along each axis.

    position: (…, 2) m. R: (2, 2) covariance of the measured position, m².
    """
    z = np.asarray(position, dtype=np.float64)
    cov = np.zeros((*z.shape[:-1], 4, 4))
    cov[..., :2, :2] = R
    cov[..., 2, 2] = cov[..., 3, 3] = speed_sigma**2
    return CvState(np.concatenate([z, np.zeros_like(z)], axis=-1), cov)


def predict(state: CvState, dt_s: float, accel_sigma: float) -> CvState:
    """The state ``dt_s`` ≥ 0 seconds later. ``accel_sigma``: m/s², along each axis. ValueError when time runs back."""
    if dt_s < 0.0:
        raise ValueError(f"a filter cannot run back in time: dt = {dt_s} s")
    F = np.eye(4)
    F[0, 2] = F[1, 3] = dt_s
    G = np.array([[dt_s**2 / 2, 0.0], [0.0, dt_s**2 / 2], [dt_s, 0.0], [0.0, dt_s]])
    return CvState(state.mean @ F.T, F @ state.cov @ F.T + accel_sigma**2 * (G @ G.T))


def update(state: CvState, z: npt.ArrayLike, R: F64) -> CvState:
    """The state after a position ``z`` (…, 2) m measured with covariance ``R`` (2, 2) m² (Joseph form)."""
    S = state.cov[..., :2, :2] + R
    K = np.linalg.solve(S, state.cov[..., :2, :]).swapaxes(-1, -2)
    keep = np.eye(4) - K @ _H
    innovation = np.asarray(z, dtype=np.float64) - state.mean[..., :2]
    cov = keep @ state.cov @ keep.swapaxes(-1, -2) + K @ R @ K.swapaxes(-1, -2)
    return CvState(state.mean + np.squeeze(K @ innovation[..., None], -1), (cov + cov.swapaxes(-1, -2)) / 2)


def mahalanobis2(state: CvState, z: npt.ArrayLike, R: F64) -> float:
    """Squared distance of one measured position from the expected one, in standard deviations: χ² with 2 degrees of
    freedom when the model holds (9.21 is its 99 % point)."""
    innovation = np.asarray(z, dtype=np.float64) - state.mean[:2]
    return float(innovation @ np.linalg.solve(state.cov[:2, :2] + R, innovation))
