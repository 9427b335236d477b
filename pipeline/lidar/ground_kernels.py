"""Compiled loops of ground fitting, explained in ``pipeline.lidar.ground``."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from pipeline.lidar.plane_kernels import refine
from pipeline.types import F32, F64, Mask

U32 = npt.NDArray[np.uint32]

MIN_COS_BEND = float(np.cos(np.radians(3.0)))
"""Neighbouring planes differ by 3° at most: the slope of roads changes by less over the length of a segment."""
X_BIN_M = 0.1
EDGE_SAMPLE = 8
"""Segment bounds are computed from every eighth point: their sizes need not be exact."""
_BLOCK = 1024
"""Number of points whose coordinates and heights fit into the L1 cache together."""


@numba.njit(cache=True, nogil=True)
def ground(
    points: F32,
    keep: Mask,
    segments: int,
    iterations: int,
    lowest: int,
    seed_m: float,
    distance_m: float,
    min_nz: float,
    reach_m: float,
    half_width_m: float,
    min_range_m: float,
) -> tuple[Mask, F64, F64, Mask]:
    """mask (N,), planes (S, 4), edges (S + 1,), fitted (S,) as in ``Ground``."""
    x, y, z = _axes(points)
    inside = _area(x, y, keep, reach_m, half_width_m, min_range_m)
    planes, edges, fitted = _fit(x, y, z, inside, segments, iterations, lowest, seed_m, distance_m, min_nz, reach_m)
    none = np.zeros(len(points), dtype=np.bool_)
    mask = _no_higher_than(x, y, z, keep, planes, edges, distance_m) if fitted.any() else none
    return mask, planes, edges, fitted


@numba.njit(cache=True, nogil=True)
def no_higher_than(points: F32, of: Mask, planes: F64, edges: F64, height_m: float) -> Mask:
    """(N,) bool: points of the mask ``of`` that are at most this high above the plane of their segment, or in a segment
    without a plane."""
    x, y, z = _axes(points)
    return _no_higher_than(x, y, z, of, planes, edges, height_m)


@numba.njit(cache=True, nogil=True)
def _axes(points: F32) -> tuple[F32, F32, F32]:
    """x, y, z (N,) float32 each: separate arrays can be vectorised."""
    count = len(points)
    x, y, z = np.empty(count, np.float32), np.empty(count, np.float32), np.empty(count, np.float32)
    for i in range(count):
        x[i], y[i], z[i] = points[i, 0], points[i, 1], points[i, 2]
    return x, y, z


@numba.njit(cache=True, nogil=True)
def _area(x: F32, y: F32, keep: Mask, reach_m: float, half_width_m: float, min_range_m: float) -> U32:
    """Indices of the kept points that are used to fit planes."""
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
def _fit(
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
    """planes (S, 4), edges (S + 1,), fitted (S,) for the points in the fitted area."""
    edges = _edges(all_x, area, segments, reach_m)
    x, y, z, starts = _by_segment(all_x, all_y, all_z, area, edges)
    planes = np.full((segments, 4), np.nan)
    raggedness = np.full(segments, np.inf)
    flat = np.array([0.0, 0.0, 1.0, 0.0])
    for s in range(segments):
        a, b = starts[s], starts[s + 1]
        plane, raggedness[s] = refine(x[a:b], y[a:b], z[a:b], flat, iterations, lowest, seed_m, distance_m, min_nz)
        _set_row(planes, s, plane)
    fitted = np.isfinite(raggedness)
    if not fitted.any():
        planes[:] = np.nan
        return planes, edges, fitted
    root = int(np.argmin(raggedness))
    placed = _agreeing(planes, edges, raggedness, distance_m)
    for k in range(1, segments):  # outwards from the root: first ahead, then back
        s = root + k if root + k < segments else segments - 1 - k
        if placed[s]:
            continue
        neighbour = planes[s - 1] if s > root else planes[s + 1]
        placed[s - 1 if s > root else s + 1] = True
        if not (fitted[s] and _meets_placed(s, planes[s], planes, edges, placed, distance_m)):
            a, b = starts[s], starts[s + 1]
            plane, ragged = refine(x[a:b], y[a:b], z[a:b], neighbour, iterations, lowest, seed_m, distance_m, min_nz)
            fitted[s] = np.isfinite(ragged) and _meets_placed(s, plane, planes, edges, placed, distance_m)
            _set_row(planes, s, plane if fitted[s] else neighbour)
    return planes, edges, fitted


@numba.njit(cache=True, nogil=True)
def _agreeing(planes: F64, edges: F64, raggedness: F64, distance_m: float) -> Mask:
    """(S,) bool: the least ragged plane, and in order of raggedness those that meet the ones before them, also across a
    more ragged one between them: that is then judged by both."""
    agreeing = np.zeros(len(planes), dtype=np.bool_)
    waiting = np.isfinite(raggedness)
    for _ in range(len(planes)):
        best = -1
        for s in range(len(planes)):
            if waiting[s] and (best < 0 or raggedness[s] < raggedness[best]):
                best = s
        if best < 0:
            break
        waiting[best] = False
        agreeing[best] = _meets_placed(best, planes[best], planes, edges, agreeing, distance_m)
    return agreeing


@numba.njit(cache=True, nogil=True)
def _meets_placed(s: int, plane: F64, planes: F64, edges: F64, placed: Mask, distance_m: float) -> bool:
    """Whether a plane of segment ``s`` meets the nearest placed ones behind and ahead, halfway between them."""
    behind, ahead = s - 1, s + 1
    while behind >= 0 and not placed[behind]:
        behind -= 1
    while ahead < len(planes) and not placed[ahead]:
        ahead += 1
    if behind >= 0 and not _meets(plane, planes[behind], 0.5 * (edges[behind + 1] + edges[s]), distance_m):
        return False
    return ahead == len(planes) or _meets(plane, planes[ahead], 0.5 * (edges[s + 1] + edges[ahead]), distance_m)


@numba.njit(cache=True, nogil=True)
def _set_row(rows: F64, index: int, row: F64) -> None:
    """rows[index] = row, in a form that compiles seconds faster: numba's plain assignment includes an error message for
    rows of another length."""
    for k in range(len(row)):
        rows[index, k] = row[k]


@numba.njit(cache=True, nogil=True)
def _meets(plane: F64, neighbour: F64, x: float, distance_m: float) -> bool:
    """Whether the road can continue from one plane to the other: about the same height straight ahead of or behind the
    ego car, at (x, 0), and no kink between them."""
    step = (plane[3] + plane[0] * x) / plane[2] - (neighbour[3] + neighbour[0] * x) / neighbour[2]
    bend = plane[0] * neighbour[0] + plane[1] * neighbour[1] + plane[2] * neighbour[2]
    return abs(step) <= distance_m and bend >= MIN_COS_BEND


@numba.njit(cache=True, nogil=True)
def _edges(x: F32, area: U32, segments: int, reach_m: float) -> F64:
    """(S + 1,) float64: bounds along x, multiples of 0.1 m, that split the area's points evenly; computed from every
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
    """x, y, z (M,) float32 of the area's points ordered by segment; (S + 1,) where each segment starts."""
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
    here, at = np.uint8(0), place[0]
    for k in range(count):
        if segment[k] != here:  # rare, so the position mostly stays in a register
            place[here] = at
            here, at = segment[k], place[segment[k]]
        i = area[k]
        x[at], y[at], z[at] = all_x[i], all_y[i], all_z[i]
        at += np.uint64(1)
    return x, y, z, starts.astype(np.int64)


@numba.njit(cache=True, nogil=True)
def _no_higher_than(x: F32, y: F32, z: F32, of: Mask, planes: F64, edges: F64, height_m: float) -> Mask:
    """Like ``no_higher_than``, for separate axes. Each block of points stays in the L1 cache for all passes."""
    lower = np.empty(len(x), dtype=np.bool_)
    for first in range(0, len(x), _BLOCK):
        block = slice(first, first + _BLOCK)
        _block_no_higher(x[block], y[block], z[block], of[block], planes, edges, height_m, lower[block])
    return lower


@numba.njit(cache=True, nogil=True)
def _block_no_higher(x: F32, y: F32, z: F32, of: Mask, planes: F64, edges: F64, height_m: float, lower: Mask) -> None:
    excess = np.empty(len(x), dtype=np.float32)
    for s in range(len(planes)):
        a, b, c = np.float32(planes[s, 0]), np.float32(planes[s, 1]), np.float32(planes[s, 2])
        d = np.float32(planes[s, 3] - height_m)
        start = np.float32(edges[s] if s > 0 else -np.inf)
        for i in range(len(x)):
            here = a * x[i] + b * y[i] + c * z[i] + d
            excess[i] = here if x[i] >= start else excess[i]
    for i in range(len(x)):
        lower[i] = of[i] & ~(excess[i] > np.float32(0.0))
