"""The height of the road ahead, also beyond its last return, with its uncertainty.

``ground`` fits planes to segments of the road to separate obstacles from it; beyond its returns, a plane has no sigma.
Here, one curve is fitted to all returns of the road ahead: height, slope, vertical curvature and cross slope, by
Bayesian linear regression (Bishop 2006, section 3.3) with Cauchy weights against outliers. The prior of the curvature
is that of roads driven at this speed, so sigma increases with distance as crests and sags do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from pipeline.types import F32, F64, Mask

NEAREST_M, FARTHEST_M, ASIDE_M = 3.0, 60.0, 6.0
"""Bounds of the returns that are used: the road ahead, no farther to the side than its own width."""
_VERTICAL_MPS2 = 0.2
"""Vertical acceleration on the sharpest crests and sags at a road's design speed: radii of 1,000 m at 50 km/h, 2,600 to
3,000 m at 80, 4,500 to 5,200 m at 100 (AASHTO, A Policy on Geometric Design of Highways and Streets, 2018, tables 3-35
and 3-37). Many roads are driven faster, so this is taken as one standard deviation."""
_SHARPEST_PM, _USUAL_PM = 1.0 / 500.0, 1.0 / 2000.0
"""Standard deviation of the vertical curvature, 1/m: the most, at low speed, and the value for unknown speed."""
_SLOPE_SIGMA, _CROSS_SIGMA, _HEIGHT_SIGMA_M = 0.1, 0.05, 1.0
"""Prior standard deviations of the road relative to the ego frame: so wide that only the returns decide."""
_NOISE_M = 0.03
"""Standard deviation of a return, including the roughness of the road."""
_INDEPENDENT = 12.0
"""Number of independent returns: those of one ring share the error of its elevation."""
_OUTLIER_M = 0.06
"""Residual at which a return has half of the weight."""
_ROUNDS = 5
"""Iterations of the reweighting."""
MIN_RETURNS = 50
"""Minimum number of returns for a fit."""


class RoadProfile(NamedTuple):
    """Height of the road at ego x and y: mean · (1, x, x²/2, y)."""

    mean: F64
    """(4,) float64 height m, slope, curvature 1/m, cross slope."""
    cov: F64
    """(4, 4) float64."""

    def height(self, xy: F64) -> F64:
        """(…) height of the road, m. xy: (…, 2) ego x and y, m."""
        x, y = xy[..., 0], xy[..., 1]
        height, slope, curvature, cross = self.mean
        z: F64 = height + slope * x + curvature * x * x / 2.0 + cross * y
        return z

    def height_sigma_m(self, x: F64) -> F64:
        """(M,) standard deviation of the height straight ahead, m. x: (M,) m."""
        rows = np.column_stack([np.ones_like(x), x, x * x / 2.0, np.zeros_like(x)])
        sigma: F64 = np.sqrt(np.einsum("ij,jk,ik->i", rows, self.cov, rows))
        return sigma


def fit_road_profile(points: F32, mask: Mask, speed_mps: float | None = None) -> RoadProfile | None:
    """The road ahead; None if too little of it returned rays.

    Args:
        points: (N, 4) float32 ``x y z intensity``, ego frame.
        mask: (N,) which of them are ground.
        speed_mps: own speed, which limits the vertical curvature of the road; None while unknown.
    """
    bends_pm = _USUAL_PM if speed_mps is None else _VERTICAL_MPS2 / max(speed_mps**2, 1.0)
    mean, cov, count = _fit(points, mask, min(bends_pm, _SHARPEST_PM))
    return RoadProfile(mean, cov) if count >= MIN_RETURNS and math.isfinite(mean.sum()) else None


@numba.njit(cache=True, nogil=True)
def _fit(points, mask, bends_pm):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Mean (4,), covariance (4, 4) and number of returns."""
    x, y, z = np.empty(len(points)), np.empty(len(points)), np.empty(len(points))
    count, start = 0, np.zeros(4)
    for i in range(len(points)):
        if mask[i] and NEAREST_M < points[i, 0] < FARTHEST_M and abs(points[i, 1]) < ASIDE_M:
            x[count], y[count], z[count] = points[i, 0], points[i, 1], points[i, 2]
            start[0] += z[count]
            count += 1
    start /= max(count, 1)
    sigmas = np.array([_HEIGHT_SIGMA_M, _SLOPE_SIGMA, bends_pm, _CROSS_SIGMA])
    prior = np.diag(1.0 / sigmas**2)
    mean: F64 = start
    precision, row = prior.copy(), np.ones(4)
    full = _INDEPENDENT / (_NOISE_M * _NOISE_M * max(count, 1))
    for turn in range(_ROUNDS):
        precision[:] = prior
        right = prior @ start
        for i in range(count):
            row[1], row[2], row[3] = x[i], 0.5 * x[i] * x[i], y[i]
            off = 0.0
            if turn > 0:
                off = (z[i] - mean[0] - row[1] * mean[1] - row[2] * mean[2] - row[3] * mean[3]) / _OUTLIER_M
            weight = full / (1.0 + off * off)
            for a in range(4):
                weighted = weight * row[a]
                right[a] += weighted * z[i]
                for b in range(a, 4):
                    precision[a, b] += weighted * row[b]
        for a in range(4):
            for b in range(a):
                precision[a, b] = precision[b, a]
        mean[:] = np.linalg.solve(precision, right)
    return mean, np.linalg.inv(precision), count
