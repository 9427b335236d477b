"""The ego lane as its two painted lines, in the ego frame on flat ground: what lane tracking hands to the corridor and
to the views. No other module of the pipeline is imported here, so that ``pipeline.types`` can hold these values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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
    """One painted line, y(x) = Σ c_k·x^k in the ego frame (x forward, y left, metres).

    coefficients: (4,) float64 c0…c3, of metres. covariance: (4, 4) float64 of them; it has grown with the time since
    the line was last measured. x_min_m, x_max_m: where paint supports the line; beyond, ``sigma_m`` says how little it
    is worth. quality: 0–1, how much the detector and the track support it. age_s: since it was last measured.
    """

    side: Side
    coefficients: F64
    covariance: F64
    x_min_m: float
    x_max_m: float
    quality: float
    age_s: float

    def y_m(self, x_m: npt.ArrayLike) -> F64:
        """Lateral place at x, metres to the left. Same shape as ``x_m``."""
        return powers(x_m) @ self.coefficients

    def sigma_m(self, x_m: npt.ArrayLike) -> F64:
        """Standard deviation of ``y_m`` at x, metres. Same shape as ``x_m``."""
        rows = powers(x_m)
        return np.sqrt(np.maximum(np.sum((rows @ self.covariance) * rows, axis=-1), 0.0))


@dataclass(frozen=True, eq=False)
class EgoLane:
    """The lines left and right of the car, null where none is believed.

    source: the lane detector's name; ``classical`` for the one without a network. age_s: since the detector last
    delivered anything. pitch_rad: the estimated pitch of the camera against its calibration, positive downwards, that
    the ground mapping used. width_m: between the lines at x = 0 … 20 m, null without both. plane: (3,) a, b, c of
    the road z = a·x + b·y + c that the mapping used.
    """

    left: LaneLine | None
    right: LaneLine | None
    source: str
    age_s: float
    pitch_rad: float
    width_m: float | None
    plane: F64
