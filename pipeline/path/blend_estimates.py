"""Blends estimates of the path into one, point by point, each weighted by the inverse of its variance.

All are compared along the normals of the most certain one. Errors of different sources are independent, so the variance
of the weighted mean is the inverse of the sum of the weights; whether one source's errors are correlated along the path
does not matter for that. Where the sources scatter more than their sigmas say, the sigma grows by the Birge ratio
(R. T. Birge, Phys. Rev. 40, 207 (1932)). A source that contradicts the rest is left out, and lowers the confidence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from pipeline.common.geometry import F64
from pipeline.path.estimates import SOURCES, STEP_M, PathEstimate
from pipeline.types import Coasting

COMPARED_M = 60.0
"""Sources are compared up to this distance: farther ahead they need not agree closely."""
LARGEST_BIRGE = 3.0
IN_DISPUTE = 1.5
"""Factor on the sigma while a source is ignored: the others may be the ones that are wrong."""
EDGE_SIGMA_M = 0.5
"""Sigma of the lane lines at which the edges lie half way between them and the usual half width."""
_SUREST_M = 1e-3
"""No source is surer than this: an uncertainty that a parameter sets to 0 would outweigh all others without limit."""


@dataclass(frozen=True, eq=False)
class FusedPath:
    """The path fused from all sources, at s = 0, 1, … m."""

    center: F64
    """(K, 2) ego x, y."""
    sigma_m: F64
    """(K,) standard deviation of the lateral position."""
    left_m: F64
    """(K,) distance from the centre to the left edge."""
    right_m: F64
    """(K,) distance from the centre to the right edge."""
    shares: F64
    """(K, S) weight of each of ``SOURCES`` in the mean."""
    behind_m: F64
    """(K,) remaining offset between the smoothed path and its sources."""


def normals(center: F64) -> F64:
    """(K, 2) unit vectors to the left of a line of (K, 2) points."""
    return _normals(center)


def fuse(
    estimates: list[PathEstimate], expected: FusedPath | None, half_width_m: float, outlier_sigmas: float
) -> tuple[FusedPath, tuple[str, ...]]:
    """One path from one or more estimates, and a sentence for each ignored source. expected: the previous frame's path,
    predicted to now; it takes part in the comparison of sources, not in the mean."""
    centers = np.stack([each.center for each in estimates])
    sigmas = np.maximum(np.stack([each.sigma_m for each in estimates]), _SUREST_M)
    compared = int(COMPARED_M / STEP_M)
    ref = int(np.argmin(np.log(sigmas[:, :compared]).mean(axis=1)))
    known = expected is not None
    memory, memory_sigma = (expected.center, expected.sigma_m) if expected else (centers[ref], sigmas[ref])
    center, sigma, weights, disagree = _fuse(
        centers, sigmas, ref, memory, memory_sigma, known, compared, outlier_sigmas, LARGEST_BIRGE, IN_DISPUTE
    )
    shares = np.zeros((len(center), len(SOURCES)))
    for row, each in zip(weights, estimates, strict=True):
        shares[:, SOURCES.index(each.source)] += row
    notes = tuple(
        f"{each.source} disagrees with the rest by {much:.0f} sigmas: ignored"
        for each, much in zip(estimates, disagree.tolist(), strict=True)
        if much > 0.0
    )
    left, right = _edges(estimates, half_width_m)
    return FusedPath(center, sigma, left, right, shares, np.zeros(len(center))), notes


def _edges(estimates: list[PathEstimate], half_width_m: float) -> tuple[F64, F64]:
    """Distances from the centre to the edges: those of the lane where its lines are known well, whichever source
    dominates the centre; elsewhere the usual half width."""
    usual = np.full(len(estimates[0].center), half_width_m)
    for each in estimates:
        if each.left_m is not None and each.right_m is not None:
            if each.source == "edges":  # these edges are parallel to the path: as far from it as they are from the car
                return each.left_m, each.right_m
            trust = EDGE_SIGMA_M**2 / (EDGE_SIGMA_M**2 + each.sigma_m**2)
            return usual + trust * (each.left_m - usual), usual + trust * (each.right_m - usual)
    return usual, usual


def blend(fresh: FusedPath, expected: FusedPath, keep: float, largest_m: float) -> FusedPath:
    """Make the path follow its sources smoothly. keep: 0–1, the weight of the expected path at equal sigmas. largest_m:
    no point moves farther than this in one frame, unless the fresh path is more certain. A path that has just lost a
    source therefore does not jump to the remaining ones.

    Both paths come from the same sources, so they are combined by covariance intersection (Julier and Uhlmann 1997):
    the weights are ``keep`` and 1 − ``keep`` times the inverse variances, and the result is never more certain than
    either.
    """
    center, sigma, kept, behind = _blend(
        fresh.center, fresh.sigma_m, expected.center, expected.sigma_m, keep, largest_m
    )
    mix = kept[:, None]
    return FusedPath(
        center,
        sigma,
        fresh.left_m + kept * (expected.left_m - fresh.left_m),
        fresh.right_m + kept * (expected.right_m - fresh.right_m),
        fresh.shares + mix * (expected.shares - fresh.shares),
        behind,
    )


def moved(
    path: FusedPath, travelled_m: float, turned_rad: float, dt_s: float, coasting: Coasting | None = None
) -> FusedPath:
    """The path of ``dt_s`` ago in the current ego frame, after a short arc. Errors of speed and yaw rate add 0.3 m
    sideways and 0.003 rad in one second, growing with the square root of time. coasting: adds the errors of a motion
    that is no longer measured; an error of the driven distance shifts a bend sideways."""
    rows = np.column_stack([path.sigma_m, path.left_m, path.right_m, path.shares])
    center, rows = _moved(path.center, rows, travelled_m, turned_rad, STEP_M)
    s = np.arange(len(center)) * STEP_M
    variance = rows[:, 0] ** 2 + (0.3**2 + (0.003 * s) ** 2) * dt_s
    if coasting is not None:
        bent2 = (normals(center)[:, 0]) ** 2
        variance = variance + coasting.turned_var_rad2 * s * s + coasting.travelled_var_m2 * bent2
    return FusedPath(center, np.sqrt(variance), rows[:, 1], rows[:, 2], rows[:, 3:], np.zeros(len(center)))


@numba.njit(cache=True, nogil=True)
def _normals(center):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Central differences, with three-point differences at the ends."""
    count = len(center)
    out = np.empty((count, 2))
    for k in range(count):
        if 0 < k < count - 1:
            dx, dy = center[k + 1, 0] - center[k - 1, 0], center[k + 1, 1] - center[k - 1, 1]
        else:
            a, b, c, way = (0, 1, 2, 1.0) if k == 0 else (count - 1, count - 2, count - 3, -1.0)
            dx = way * (4.0 * center[b, 0] - 3.0 * center[a, 0] - center[c, 0])
            dy = way * (4.0 * center[b, 1] - 3.0 * center[a, 1] - center[c, 1])
        length = max(np.sqrt(dx * dx + dy * dy), 1e-12)
        out[k, 0], out[k, 1] = -dy / length, dx / length
    return out


@numba.njit(cache=True, nogil=True)
def _fuse(centers, sigmas, ref, memory, memory_sigma, known, compared, limit, largest, dispute_factor):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Weighted mean along the normals of source ``ref``. Sources are left out one by one, the worst first, while one
    differs by more than ``limit`` sigmas (root mean square up to ``compared``) from all the others and two others
    remain; the remembered path counts as one. disagree: that deviation for the sources left out, else 0."""
    count, size = sigmas.shape
    normal = _normals(centers[ref])
    d = np.empty((count + 1, size))
    var = np.empty((count + 1, size))
    for i in range(count + 1):
        for k in range(size):
            x = centers[i, k, 0] if i < count else memory[k, 0]
            y = centers[i, k, 1] if i < count else memory[k, 1]
            sigma = sigmas[i, k] if i < count else memory_sigma[k]
            d[i, k] = normal[k, 0] * (x - centers[ref, k, 0]) + normal[k, 1] * (y - centers[ref, k, 1])
            var[i, k] = sigma * sigma
    used = np.ones(count + 1, np.bool_)
    used[count] = known
    disagree = np.zeros(count)
    while used.sum() > 2:
        worst, worst_much = -1, limit
        for i in range(count):
            if used[i]:
                much = _against_the_rest(d, var, used, i, min(compared, size))
                if much > worst_much:
                    worst, worst_much = i, much
        if worst < 0 or used[:count].sum() < 2:
            break
        used[worst] = False
        disagree[worst] = worst_much
    dispute = dispute_factor if disagree.any() else 1.0
    center, sigma, weights = np.empty((size, 2)), np.empty(size), np.zeros((count, size))
    for k in range(size):
        total, mean = 0.0, 0.0
        for i in range(count):
            if used[i]:
                total += 1.0 / var[i, k]
                mean += d[i, k] / var[i, k]
        mean /= total
        chi2, free = 0.0, -1.0
        for i in range(count):
            if used[i]:
                weights[i, k] = 1.0 / var[i, k] / total
                chi2 += (d[i, k] - mean) ** 2 / var[i, k]
                free += 1.0
        birge = min(np.sqrt(chi2 / free), largest) if free > 0.0 else 1.0
        sigma[k] = np.sqrt(1.0 / total) * max(birge, 1.0) * dispute
        center[k, 0] = centers[ref, k, 0] + normal[k, 0] * mean
        center[k, 1] = centers[ref, k, 1] + normal[k, 1] * mean
    return center, sigma, weights, disagree


@numba.njit(cache=True, nogil=True)
def _against_the_rest(d, var, used, i, size):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Deviation of source i from the weighted mean of the others in sigmas, root mean square along the path."""
    much2 = 0.0
    for k in range(size):
        total, mean = 0.0, 0.0
        for j in range(len(used)):
            if used[j] and j != i:
                total += 1.0 / var[j, k]
                mean += d[j, k] / var[j, k]
        much2 += (d[i, k] - mean / total) ** 2 / (var[i, k] + 1.0 / total)
    return np.sqrt(much2 / size)


@numba.njit(cache=True, nogil=True)
def _blend(fresh, fresh_sigma, old, old_sigma, keep, largest):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Covariance intersection along the normals of the fresh path, with limited step size."""
    size = len(fresh)
    normal = _normals(fresh)
    center, sigma, kept, behind = np.empty((size, 2)), np.empty(size), np.empty(size), np.zeros(size)
    for k in range(size):
        apart = normal[k, 0] * (old[k, 0] - fresh[k, 0]) + normal[k, 1] * (old[k, 1] - fresh[k, 1])
        a, b = keep / old_sigma[k] ** 2, (1.0 - keep) / fresh_sigma[k] ** 2
        share = a / (a + b)
        sigma[k] = np.sqrt(1.0 / (a + b))
        step = abs(apart) * (1.0 - share)
        allowed = largest + np.sqrt(max(old_sigma[k] ** 2 - fresh_sigma[k] ** 2, 0.0))
        if step > allowed:
            share = 1.0 - allowed / abs(apart)
            behind[k] = step - allowed
        kept[k] = share
        center[k, 0] = fresh[k, 0] + normal[k, 0] * share * apart
        center[k, 1] = fresh[k, 1] + normal[k, 1] * share * apart
    return center, sigma, kept, behind


@numba.njit(cache=True, nogil=True)
def _moved(center, rows, travelled, turned, spacing):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Points transformed to the new ego frame and resampled from the foot of its origin on. Beyond the last point, the
    line is extended straight, and its sigma grows by 0.1 m per metre."""
    size, columns = rows.shape
    mx, my = travelled * np.cos(0.5 * turned), travelled * np.sin(0.5 * turned)
    c, s = np.cos(turned), np.sin(turned)
    points = np.empty((size, 2))
    for k in range(size):
        x, y = center[k, 0] - mx, center[k, 1] - my
        points[k, 0], points[k, 1] = x * c + y * s, y * c - x * s
    first, start = 0, 0.0
    for k in range(size - 1):
        dx, dy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        length = max(np.sqrt(dx * dx + dy * dy), 1e-9)
        t = -(points[k, 0] * dx + points[k, 1] * dy) / length
        if t < length or k == size - 2:
            first, start = k, t
            break
    new, new_rows = np.empty((size, 2)), np.empty((size, columns))
    k, into = first, start
    for n in range(size):
        while True:
            dx, dy = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
            length = max(np.sqrt(dx * dx + dy * dy), 1e-9)
            if into <= length or k == size - 2:
                break
            into -= length
            k += 1
        new[n, 0], new[n, 1] = points[k, 0] + into * dx / length, points[k, 1] + into * dy / length
        share = min(max(into / length, 0.0), 1.0)
        for j in range(columns):
            new_rows[n, j] = rows[k, j] + share * (rows[k + 1, j] - rows[k, j])
        new_rows[n, 0] += 0.1 * max(into - length, 0.0)
        into += spacing
    return new, new_rows
