"""The ego lane as its two painted lines, in the ego frame on flat ground, as lane tracking passes it to the corridor
and the views. This module imports no other module of the pipeline, so that ``pipeline.types`` can use it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numba
import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
Side = Literal["left", "right"]


def powers(x_m: npt.ArrayLike) -> F64:
    """``1 x x² x³`` of each x: (..., 4) float64, so that ``powers(x) @ coefficients`` is y."""
    x = np.asarray(x_m, np.float64)
    return np.stack([np.ones_like(x), x, x * x, x * x * x], axis=-1)


@dataclass(frozen=True, eq=False)
class LaneLine:
    """One painted line, y(x) = Σ c_k·x^k in the ego frame (x forward, y left, metres)."""

    side: Side
    """On which side of the car it is."""
    coefficients: F64
    """(4,) float64 c0 … c3, with x and y in metres."""
    covariance: F64
    """(4, 4) float64, of the coefficients; grows while the line is not measured."""
    x_min_m: float
    """x where the support by paint starts."""
    x_max_m: float
    """x where it ends."""
    quality: float
    """0–1, how well the detector and the tracking support it."""
    age_s: float
    """Time since it was last measured."""

    def y_m(self, x_m: npt.ArrayLike) -> F64:
        """Lateral position at x, metres to the left. Same shape as ``x_m``."""
        return powers(x_m) @ self.coefficients

    def along(self, x_m: F64) -> tuple[F64, F64]:
        """``y_m`` and ``sigma_m`` at places x (K,), faster."""
        y_m, sigma_m = _along(self.coefficients, self.covariance, x_m)
        return y_m, sigma_m

    def sigma_m(self, x_m: npt.ArrayLike) -> F64:
        """Standard deviation of ``y_m`` at x, metres. Same shape as ``x_m``."""
        rows = powers(x_m)
        return np.sqrt(np.maximum(np.sum((rows @ self.covariance) * rows, axis=-1), 0.0))


@numba.njit(cache=True, nogil=True)
def _along(coefficients, covariance, x_m):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Kernel of ``LaneLine.along``."""
    y_m, sigma_m, row = np.empty(len(x_m)), np.empty(len(x_m)), np.ones(4)
    for n in range(len(x_m)):
        row[1], row[2], row[3] = x_m[n], x_m[n] * x_m[n], x_m[n] * x_m[n] * x_m[n]
        y, variance = 0.0, 0.0
        for i in range(4):
            y += row[i] * coefficients[i]
            for j in range(4):
                variance += row[i] * covariance[i, j] * row[j]
        y_m[n], sigma_m[n] = y, np.sqrt(max(variance, 0.0))
    return y_m, sigma_m


def warm_up() -> None:
    """Compile the kernel, or load it from numba's cache, also for read-only places."""
    x_m = np.zeros(2)
    for writeable in (True, False):
        x_m.flags.writeable = writeable
        _along(np.zeros(4), np.eye(4), x_m)


@dataclass(frozen=True, eq=False)
class EgoLane:
    """The lines left and right of the car."""

    left: LaneLine | None
    """None if no line is confirmed."""
    right: LaneLine | None
    """None if no line is confirmed."""
    source: str
    """The lane detector's name; ``classical`` for the one without a network."""
    age_s: float
    """Time since the lane detector last delivered a result."""
    pitch_rad: float
    """Estimated pitch of the camera against its calibration, positive downwards, used to map the lines to the road."""
    width_m: float | None
    """Mean distance between the lines at x = 0 … 20 m; None without both."""
    plane: F64
    """(3,) a, b, c of the road z = a·x + b·y + c, used to map the lines."""
