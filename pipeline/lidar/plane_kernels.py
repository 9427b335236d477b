"""Compiled loops that fit one plane to the low points of one segment, explained in ``pipeline.lidar.ground``."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from pipeline.types import F32, F64

MIN_SEEDS = 20
"""Minimum number of points for a plane."""
MIN_SPREAD_M = 0.7
"""Minimum standard deviation of the seeds along both directions of their plane; below it they form a line."""
MIN_SHARE = 0.05
"""A plane with a smaller share of its segment's points is not the road."""
LOWEST_SHARE = 5
"""At most one in five points of a segment is used as its lowest points; otherwise sparse segments would include cars.
"""
HEIGHT_BINS, HEIGHT_LOW_M, BINS_PER_M = 2000, -10.0, 100


@numba.njit(cache=True, nogil=True)
def refine(
    x: F32,
    y: F32,
    z: F32,
    prior: F64,
    iterations: int,
    lowest: int,
    seed_m: float,
    distance_m: float,
    min_nz: float,
) -> tuple[F64, float]:
    """One segment: its plane (4,) and a cost in m: the standard deviation of its points and of those below from the
    plane, divided by the share of its points in the segment's; infinite if it cannot be the road. Hardly anything lies
    below a road, but much below a plane through a hedge or a row of parked cars. ``prior`` (4,) defines the downward
    direction.

    The band around the plane narrows evenly from ``seed_m`` to ``distance_m``: a narrow band from the start would only
    select the strip of a tilted road that contains the lowest points.
    """
    plane, count, across = prior.copy(), 0.0, 0.0
    low, high = _seed_heights(x, y, z, prior, lowest, seed_m)
    for k in range(1, iterations + 1):
        count, mean, cov = _moments(x, y, z, plane, low, high)
        if count < max(MIN_SEEDS, MIN_SHARE * len(x)):
            return plane, np.inf
        normal, across, along = _flattest(cov)
        if along < MIN_SPREAD_M * MIN_SPREAD_M or normal[2] < min_nz:
            return plane, np.inf
        plane[0], plane[1], plane[2] = normal[0], normal[1], normal[2]
        plane[3] = -(normal[0] * mean[0] + normal[1] * mean[1] + normal[2] * mean[2])
        high = distance_m + max(seed_m - distance_m, 0.0) * max(iterations - 1 - k, 0) / max(iterations - 1, 1)
        low = -high
    below, squares = _below(x, y, z, plane, distance_m, seed_m)
    off = np.sqrt((max(across, 0.0) * count + squares) / (count + below))
    return plane, off * len(x) / count


@numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _below(x: F32, y: F32, z: F32, plane: F64, distance_m: float, deepest_m: float) -> tuple[float, float]:
    """Number of points more than ``distance_m`` below the plane, and the sum of their squared depths, each at most
    ``deepest_m``: a ditch beside the road does not make its plane worse than that of a hedge."""
    one, none = np.float32(1.0), np.float32(0.0)
    a, b, c, d = np.float32(plane[0]), np.float32(plane[1]), np.float32(plane[2]), np.float32(plane[3])
    low, deepest = np.float32(-distance_m), np.float32(max(deepest_m, distance_m))
    count = squares = none
    for i in range(len(x)):
        h = a * x[i] + b * y[i] + c * z[i] + d
        w = one if h < low else none
        depth = min(-h, deepest)
        count += w
        squares += w * depth * depth
    return float(count), float(squares)


@numba.njit(cache=True, nogil=True)
def _seed_heights(x: F32, y: F32, z: F32, prior: F64, lowest: int, seed_m: float) -> tuple[float, float]:
    """Bounds of the seeds' height above ``prior``: the mean of the lowest points ± ``seed_m``.

    Heights are quantised to whole centimetres, so that the lowest can be found without sorting.
    """
    a, b, c = np.float32(prior[0]), np.float32(prior[1]), np.float32(prior[2])
    d, scale = np.float32(prior[3] - HEIGHT_LOW_M), np.float32(BINS_PER_M)
    bottom, top = np.float32(0.0), np.float32(HEIGHT_BINS - 1)
    levels = np.empty(len(x), dtype=np.uint16)
    for i in range(len(x)):
        levels[i] = np.uint16(min(max((a * x[i] + b * y[i] + c * z[i] + d) * scale, bottom), top))
    wanted = min(max(1, min(lowest, len(x) // LOWEST_SHARE)), len(x))
    least, most = 0, HEIGHT_BINS - 1
    while least < most:  # bisection for the highest level among them: eleven vectorised counts
        middle = (least + most) // 2
        if _up_to(levels, middle)[0] >= wanted:
            most = middle
        else:
            least = middle + 1
    below, total = _up_to(levels, least - 1)
    total += (wanted - below) * least
    mean = (total / float(max(wanted, 1)) + 0.5) / BINS_PER_M + HEIGHT_LOW_M
    return mean - seed_m, mean + seed_m


@numba.njit(cache=True, nogil=True)
def _up_to(levels: npt.NDArray[np.uint16], highest: int) -> tuple[int, int]:
    """Number of levels up to this one, and their sum."""
    count, total = np.uint32(0), np.uint32(0)
    for i in range(len(levels)):
        counts = np.uint32(levels[i] <= highest)
        count += counts
        total += counts * np.uint32(levels[i])
    return int(count), int(total)


@numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _moments(x: F32, y: F32, z: F32, plane: F64, low_m: float, high_m: float) -> tuple[float, F64, F64]:
    """Count, mean (3,) and covariance (3, 3) of the points whose height above ``plane`` lies in low_m … high_m.

    One branch-free pass in single precision, which the compiler vectorises. Sums are relative to the first point to
    keep cancellation errors small.
    """
    one, none = np.float32(1.0), np.float32(0.0)
    a, b, c, d = np.float32(plane[0]), np.float32(plane[1]), np.float32(plane[2]), np.float32(plane[3])
    low, high = np.float32(low_m), np.float32(high_m)
    ox, oy, oz = (x[0], y[0], z[0]) if len(x) else (none, none, none)
    n = sx = sy = sz = sxx = syy = szz = sxy = sxz = syz = none
    for i in range(len(x)):
        h = a * x[i] + b * y[i] + c * z[i] + d
        w = one if (h >= low) & (h <= high) else none
        px, py, pz = x[i] - ox, y[i] - oy, z[i] - oz
        wx, wy, wz = w * px, w * py, w * pz
        n += w
        sx += wx
        sy += wy
        sz += wz
        sxx += wx * px
        syy += wy * py
        szz += wz * pz
        sxy += wx * py
        sxz += wx * pz
        syz += wy * pz
    k = 1.0 / max(float(n), 1.0)
    mx, my, mz = sx * k, sy * k, sz * k  # double precision from here on
    cov = np.empty((3, 3))
    cov[0, 0], cov[1, 1], cov[2, 2] = sxx * k - mx * mx, syy * k - my * my, szz * k - mz * mz
    cov[0, 1] = cov[1, 0] = sxy * k - mx * my
    cov[0, 2] = cov[2, 0] = sxz * k - mx * mz
    cov[1, 2] = cov[2, 1] = syz * k - my * mz
    return float(n), np.array([mx + ox, my + oy, mz + oz]), cov


@numba.njit(cache=True, nogil=True)
def _flattest(cov: F64) -> tuple[F64, float, float]:
    """For a symmetric (3, 3) covariance: the eigenvector of the smallest eigenvalue, pointing up, that eigenvalue, and
    the middle one. Cyclic Jacobi rotations (Golub, Van Loan, *Matrix Computations*, section 8.5)."""
    m, v = cov.copy(), np.eye(3)
    negligible = 1e-30 * (m[0, 0] + m[1, 1] + m[2, 2]) ** 2
    for _ in range(8):
        if m[0, 1] ** 2 + m[0, 2] ** 2 + m[1, 2] ** 2 <= negligible:
            break
        for p, q in ((0, 1), (0, 2), (1, 2)):
            if m[p, q] == 0.0:
                continue
            theta = (m[q, q] - m[p, p]) / (2.0 * m[p, q])
            t = (1.0 if theta >= 0.0 else -1.0) / (abs(theta) + np.sqrt(theta * theta + 1.0))
            c = 1.0 / np.sqrt(t * t + 1.0)
            s = t * c
            for k in range(3):
                m[k, p], m[k, q] = c * m[k, p] - s * m[k, q], s * m[k, p] + c * m[k, q]
            for k in range(3):
                m[p, k], m[q, k] = c * m[p, k] - s * m[q, k], s * m[p, k] + c * m[q, k]
            for k in range(3):
                v[k, p], v[k, q] = c * v[k, p] - s * v[k, q], s * v[k, p] + c * v[k, q]
    least = 0
    for k in range(1, 3):
        if m[k, k] < m[least, least]:
            least = k
    middle = min(m[(least + 1) % 3, (least + 1) % 3], m[(least + 2) % 3, (least + 2) % 3])
    upwards = 1.0 if v[2, least] > 0.0 else -1.0
    return v[:, least] * upwards, m[least, least], middle
