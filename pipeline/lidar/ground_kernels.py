"""Compiled loops of ground fitting; ``pipeline.lidar.ground`` says what they are for and why."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from pipeline.types import F32, F64

Mask = npt.NDArray[np.bool_]
U32 = npt.NDArray[np.uint32]

MIN_SEEDS = 20
"""Fewer points than this carry no plane."""
MIN_SPREAD_M = 0.7
"""Standard deviation that the seeds need along both directions of their plane; below it they are a line."""
MIN_SHARE = 0.05
"""Nor is it the road where it holds less than this share of its segment's points."""
MIN_COS_BEND = float(np.cos(np.radians(3.0)))
"""Neighbouring planes turn by 3° at most: roads change their slope by less over the length of a segment."""
LOWEST_SHARE = 5
"""The lowest points are at most one in five of a segment's: sparse segments would else count cars among them."""
X_BIN_M = 0.1
EDGE_SAMPLE = 8
"""Segments are cut by every eighth point: their sizes need not be exact."""
HEIGHT_BINS, HEIGHT_LOW_M, BINS_PER_M = 2000, -10.0, 100


@numba.njit(cache=True, nogil=True)
def axes(points: F32) -> tuple[F32, F32, F32]:
    """x, y, z (N,) float32 each: separate arrays are what vector instructions can read."""
    count = len(points)
    x, y, z = np.empty(count, np.float32), np.empty(count, np.float32), np.empty(count, np.float32)
    for i in range(count):
        x[i], y[i], z[i] = points[i, 0], points[i, 1], points[i, 2]
    return x, y, z


@numba.njit(cache=True, nogil=True)
def area(x: F32, y: F32, keep: Mask, reach_m: float, half_width_m: float, min_range_m: float) -> U32:
    """Indices of the kept points that planes are fitted to."""
    reach, half_width = np.float32(reach_m), np.float32(half_width_m)
    near2 = np.float32(min_range_m * min_range_m)
    inside = np.empty(len(x), dtype=np.bool_)
    for i in range(len(x)):
        inside[i] = keep[i] & (abs(x[i]) < reach) & (abs(y[i]) < half_width) & (x[i] * x[i] + y[i] * y[i] >= near2)
    chosen = np.empty(len(x) + 1, dtype=np.uint32)
    count = 0
    for i in range(len(x)):
        chosen[count] = i
        count += inside[i]
    return chosen[:count]


@numba.njit(cache=True, nogil=True)
def fit(
    all_x: F32,
    all_y: F32,
    all_z: F32,
    area: U32,
    segments: int,
    iterations: int,
    lowest: int,
    seed_m: float,
    distance_m: float,
    min_nz: float,
    reach_m: float,
) -> tuple[F64, F64, Mask]:
    """planes (S, 4), edges (S + 1,), fitted (S,) of the points in the area of the fit."""
    edges = _edges(all_x, area, segments, reach_m)
    x, y, z, starts = _by_segment(all_x, all_y, all_z, area, edges)
    planes = np.full((segments, 4), np.nan)
    raggedness = np.full(segments, np.inf)
    flat = np.array([0.0, 0.0, 1.0, 0.0])
    for s in range(segments):
        a, b = starts[s], starts[s + 1]
        planes[s], raggedness[s] = _refine(x[a:b], y[a:b], z[a:b], flat, iterations, lowest, seed_m, distance_m, min_nz)
    fitted = np.isfinite(raggedness)
    if not fitted.any():
        planes[:] = np.nan
        return planes, edges, fitted
    root = int(np.argmin(raggedness))
    for k in range(1, segments):  # from the root ahead, then from the root back
        s = root + k if root + k < segments else segments - 1 - k
        neighbour = planes[s - 1] if s > root else planes[s + 1]
        shared = edges[s] if s > root else edges[s + 1]
        if fitted[s] and _meets(planes[s], neighbour, shared, distance_m):
            continue
        a, b = starts[s], starts[s + 1]
        plane, ragged = _refine(x[a:b], y[a:b], z[a:b], neighbour, iterations, lowest, seed_m, distance_m, min_nz)
        fitted[s] = np.isfinite(ragged) and _meets(plane, neighbour, shared, distance_m)
        planes[s] = plane if fitted[s] else neighbour
    return planes, edges, fitted


@numba.njit(cache=True, nogil=True)
def _meets(plane: F64, neighbour: F64, x: float, distance_m: float) -> bool:
    """Whether a road can go on from one plane to the other: about one height straight ahead of or behind the ego, at
    (x, 0), and no kink between them."""
    step = (plane[3] + plane[0] * x) / plane[2] - (neighbour[3] + neighbour[0] * x) / neighbour[2]
    bend = plane[0] * neighbour[0] + plane[1] * neighbour[1] + plane[2] * neighbour[2]
    return abs(step) <= distance_m and bend >= MIN_COS_BEND


@numba.njit(cache=True, nogil=True)
def _edges(x: F32, area: U32, segments: int, reach_m: float) -> F64:
    """(S + 1,) float64: bounds along x, multiples of 0.1 m, that split the area's points evenly; judged by every
    eighth point."""
    bins = int(np.ceil(2.0 * reach_m / X_BIN_M))
    histogram = np.zeros(bins + 1, dtype=np.int32)
    total = 0
    for k in range(0, len(area), EDGE_SAMPLE):
        histogram[int((x[area[k]] + reach_m) / X_BIN_M)] += 1
        total += 1
    edges = np.full(segments + 1, reach_m)
    edges[0] = -reach_m
    seen, s = 0, 0
    for b in range(bins + 1):
        while s < segments - 1 and seen * segments >= total * (s + 1):
            s += 1
            edges[s] = b * X_BIN_M - reach_m
        seen += histogram[b]
    return edges


@numba.njit(cache=True, nogil=True)
def _by_segment(
    all_x: F32, all_y: F32, all_z: F32, area: U32, edges: F64
) -> tuple[F32, F32, F32, npt.NDArray[np.int64]]:
    """x, y, z (M,) float32 of the area's points in the order of their segments; (S + 1,) where each segment starts."""
    segments, count = len(edges) - 1, len(area)
    x, y, z = np.empty(count, np.float32), np.empty(count, np.float32), np.empty(count, np.float32)
    for k in range(count):
        x[k] = all_x[area[k]]
    segment = np.zeros(count, dtype=np.uint8)
    for s in range(1, segments):
        edge = np.float32(edges[s])
        for k in range(count):
            segment[k] += np.uint8(x[k] >= edge)
    starts = np.zeros(segments + 1, dtype=np.uint64)
    for s in range(segments):
        size = 0
        for k in range(count):
            size += segment[k] == s
        starts[s + 1] = starts[s] + np.uint64(size)
    place = starts.copy()
    for k in range(count):
        at, i = place[segment[k]], area[k]
        place[segment[k]] = at + np.uint64(1)
        x[at], y[at], z[at] = all_x[i], all_y[i], all_z[i]
    return x, y, z, starts.astype(np.int64)


@numba.njit(cache=True, nogil=True)
def _refine(
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
    """One segment: its plane (4,), and how ragged that is: the standard deviation of its points across it over their
    share of the segment's points, m; infinite where it cannot be the road. ``prior`` (4,) says which way is low.

    The band around the plane narrows evenly from ``seed_m`` to ``distance_m``: taken at once, a narrow band keeps to
    the strip of a tilted road that the lowest points came from."""
    plane, raggedness = prior.copy(), np.inf
    low, high = _seed_heights(x, y, z, prior, lowest, seed_m)
    for k in range(1, iterations + 1):
        count, mean, cov = _moments(x, y, z, plane, low, high)
        if count < max(MIN_SEEDS, MIN_SHARE * len(x)):
            return plane, np.inf
        normal, across, along = _flattest(cov)
        if along < MIN_SPREAD_M * MIN_SPREAD_M or normal[2] < min_nz:
            return plane, np.inf
        plane[:3] = normal
        plane[3] = -(normal[0] * mean[0] + normal[1] * mean[1] + normal[2] * mean[2])
        raggedness = np.sqrt(max(across, 0.0)) * len(x) / count
        high = distance_m + max(seed_m - distance_m, 0.0) * max(iterations - 1 - k, 0) / max(iterations - 1, 1)
        low = -high
    return plane, raggedness


@numba.njit(cache=True, nogil=True)
def _seed_heights(x: F32, y: F32, z: F32, prior: F64, lowest: int, seed_m: float) -> tuple[float, float]:
    """Bounds of the seeds' height over ``prior``: the mean of the lowest points ± ``seed_m``.

    Heights are counted in whole centimetres, so that the lowest are found without sorting.
    """
    a, b, c = np.float32(prior[0]), np.float32(prior[1]), np.float32(prior[2])
    d, scale = np.float32(prior[3] - HEIGHT_LOW_M), np.float32(BINS_PER_M)
    bottom, top = np.float32(0.0), np.float32(HEIGHT_BINS - 1)
    levels = np.empty(len(x), dtype=np.uint16)
    for i in range(len(x)):  # apart from the counting, which cannot use vector instructions
        levels[i] = np.uint16(min(max((a * x[i] + b * y[i] + c * z[i] + d) * scale, bottom), top))
    histogram = np.zeros(HEIGHT_BINS, dtype=np.int32)
    for i in range(len(x)):
        histogram[levels[i]] += 1
    wanted = max(1, min(lowest, len(x) // LOWEST_SHARE))
    taken, total = 0, 0
    for level in range(HEIGHT_BINS):
        n = min(histogram[level], wanted - taken)
        taken += n
        total += n * level
        if taken == wanted:
            break
    mean = (total / float(max(taken, 1)) + 0.5) / BINS_PER_M + HEIGHT_LOW_M
    return mean - seed_m, mean + seed_m


@numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _moments(x: F32, y: F32, z: F32, plane: F64, low_m: float, high_m: float) -> tuple[float, F64, F64]:
    """Count, mean (3,) and covariance (3, 3) of the points whose height over ``plane`` lies in low_m … high_m.

    One branch-free pass in single precision, which the compiler turns into vector instructions. Sums are taken around
    the first point, so that what cancels is small.
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
    """Of a symmetric (3, 3) covariance: the eigenvector of the smallest eigenvalue, pointing up, that eigenvalue, and
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


@numba.njit(cache=True, nogil=True)
def no_higher_than(x: F32, y: F32, z: F32, of: Mask, planes: F64, edges: F64, height_m: float) -> Mask:
    """(N,) bool: those of the mask ``of`` no higher than this over the plane of their segment, or without a plane."""
    excess = np.empty(len(x), dtype=np.float32)
    for s in range(len(planes)):
        a, b, c = np.float32(planes[s, 0]), np.float32(planes[s, 1]), np.float32(planes[s, 2])
        d = np.float32(planes[s, 3] - height_m)
        start = np.float32(edges[s] if s > 0 else -np.inf)
        for i in range(len(x)):
            here = a * x[i] + b * y[i] + c * z[i] + d
            excess[i] = here if x[i] >= start else excess[i]
    return of & ~(excess > np.float32(0.0))
