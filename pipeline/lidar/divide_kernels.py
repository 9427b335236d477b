"""The compiled loops behind ``divide_tracked``: which tracks reach a cluster, whose seeds its points are, and how the
rest joins them."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.types import F32, F64, I32, Mask

AROUND_M = 0.3
"""Returns this far outside an expected footprint still belong to it: two standard deviations of a cluster's position.
"""


OUTSIDE = -2
"""Owner of a point that is beside or before every track of its cluster."""
_STEP_M = 0.3
"""A return nearer than another by this is before its surface: ten times the noise of a VLP-16's range."""


@numba.njit(cache=True, nogil=True)
def reach_clusters(points: F32, labels: I32, footprints: F64, clusters: int) -> tuple[Mask, F64, F64]:
    """(T, C) bool: the clusters whose bounds along ego x and y are near each footprint's bounds; and (C, 2) these
    bounds, lowest and highest x and y, m."""
    low, high = np.full((clusters, 2), np.inf), np.full((clusters, 2), -np.inf)
    for i in range(len(points)):
        if labels[i] >= 0:
            for axis in range(2):
                low[labels[i], axis] = min(low[labels[i], axis], points[i, axis])
                high[labels[i], axis] = max(high[labels[i], axis], points[i, axis])
    reached = np.zeros((len(footprints), clusters), dtype=np.bool_)
    for t in range(len(footprints)):
        x, y, length, width, cos, sin = footprints[t]
        along, across = length * abs(cos) + width * abs(sin), length * abs(sin) + width * abs(cos)
        for c in range(clusters):
            outside_x = max(low[c, 0] - x, x - high[c, 0]) - along
            outside_y = max(low[c, 1] - y, y - high[c, 1]) - across
            reached[t, c] = max(outside_x, outside_y) <= AROUND_M
    return reached, low, high


@numba.njit(cache=True, nogil=True)
def find_owners(
    points: F32, labels: I32, footprints: F64, sides: F64, likely: F64, nearest: F64, reached: Mask, wide: Mask
) -> I32:
    """(N,) int32 the only footprint that contains a clustered point or is close to it, −1 for none or several, OUTSIDE
    for a point beside or before all of them.

    sides, likely: (T, 2) lateral extent of each track, by the speed that is sure and by the likely one. Beside it, no
    point is surely its own. The first holds in ``wide`` clusters, (C,) bool, which are divided on less evidence, the
    second in others. nearest: (T,) ego x below which no point is. reached: (T, C) bool, the footprints to test for each
    cluster.
    """
    near = np.empty((reached.shape[1], len(footprints)), dtype=np.int32)
    count = np.zeros(reached.shape[1], dtype=np.int32)
    for c in range(reached.shape[1]):
        for t in range(len(footprints)):
            if reached[t, c]:
                near[c, count[c]] = t
                count[c] += 1
    owner = np.full(len(points), -1, dtype=np.int32)
    for i in range(len(points)):
        if labels[i] < 0:
            continue
        found, beside = 0, 0
        side = sides if wide[labels[i]] else likely
        for k in range(count[labels[i]]):
            t = near[labels[i], k]
            x, y, length, width, cos, sin = footprints[t]
            dx, dy = points[i, 0] - x, points[i, 1] - y
            along, across = abs(dx * cos + dy * sin) - length, abs(dy * cos - dx * sin) - width
            is_beside = max(side[t, 0] - points[i, 1], points[i, 1] - side[t, 1]) > AROUND_M
            if is_beside or points[i, 0] < nearest[t]:
                beside += 1
                continue
            if np.hypot(max(along, 0.0), max(across, 0.0)) <= AROUND_M:
                owner[i] = t
                found += 1
        if found > 1:
            owner[i] = -1
        elif beside > 0 and beside == count[labels[i]]:
            owner[i] = OUTSIDE
    return owner


@numba.njit(cache=True, nogil=True)
def count_seeds(labels: I32, owner: I32, tracks: int, clusters: int) -> I32:
    """(T, C) int32 number of seeds of each track in each cluster."""
    counts = np.zeros((tracks, clusters), dtype=np.int32)
    for i in range(len(labels)):
        if labels[i] >= 0 and owner[i] >= 0:
            counts[owner[i], labels[i]] += 1
    return counts


@numba.njit(cache=True, nogil=True)
def divide_cluster(
    points: F32, seeds: I32, together: F64, rays_rad: float, z_weight: float, cell_m: float, most_cells: int
) -> I32:
    """(M,) int32 the part of each point of a cluster, numbered from 0 in the order of the seeds' groups; all 0 if it
    stays whole, as with more than ``most_cells`` cells of ``cell_m``, of which each counts as one return.

    seeds: (M,) group of each seed, −1 for the other points. together: (G, G) two groups are one part if the gap between
    them, m, is no larger than this. rays_rad: they also are if the last group has a return no nearer than one of the
    other that is closer to it than this in azimuth.
    """
    cell, first = _thinned(points, z_weight, cell_m)
    if len(first) > most_cells:
        return np.zeros(len(points), dtype=np.int32)
    seed = np.full(len(first), -1, dtype=np.int32)
    for i in range(len(points)):
        seed[cell[i]] = max(seed[cell[i]], seeds[i])
    group = _join(points[first], seed, z_weight)
    gaps = _measure_gaps(points[first], group, len(together), rays_rad, z_weight)
    part = _grouped(gaps, together)
    number, used = np.full(len(part), -1, dtype=np.int32), np.zeros(len(part), dtype=np.bool_)
    for k in range(len(group)):
        used[part[group[k]]] = True
    count = 0
    for n in range(len(part)):
        if used[n]:
            number[n] = count
            count += 1
    found = np.empty(len(points), dtype=np.int32)
    for i in range(len(points)):
        found[i] = number[part[group[cell[i]]]]
    return found


@numba.njit(cache=True, nogil=True)
def _thinned(points, z_weight, cell_m):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(M,) the cell of each point, and (K,) the first point of each cell."""
    place = np.empty((len(points), 3), dtype=np.int64)
    for i in range(len(points)):
        for axis in range(3):
            place[i, axis] = np.floor(np.float64(points[i, axis]) * (z_weight if axis == 2 else 1.0) / cell_m)
    low, high = place[0].copy(), place[0].copy()
    for i in range(len(points)):
        for axis in range(3):
            low[axis], high[axis] = min(low[axis], place[i, axis]), max(high[axis], place[i, axis])
    deep, tall = high[1] - low[1] + 1, high[2] - low[2] + 1
    key = ((place[:, 0] - low[0]) * deep + place[:, 1] - low[1]) * tall + place[:, 2] - low[2]
    order = np.argsort(key, kind="mergesort")
    cell, first = np.empty(len(points), dtype=np.int64), np.empty(len(points), dtype=np.int64)
    count = 0
    for k in range(len(order)):
        if k == 0 or key[order[k]] != key[order[k - 1]]:
            first[count] = order[k]
            count += 1
        cell[order[k]] = count - 1
    return cell, first[:count]


@numba.njit(cache=True, nogil=True)
def _grouped(gaps, together):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(G,) the connected component of each group, numbered from 0, where pairs no farther apart than ``together`` are
    connected."""
    part = np.full(len(gaps), -1, dtype=np.int32)
    count, reached = 0, np.empty(len(gaps), dtype=np.int64)
    for n in range(len(gaps)):
        if part[n] >= 0:
            continue
        reached[0], part[n], left = n, count, 1
        while left > 0:
            left -= 1
            at = reached[left]
            for k in range(len(gaps)):
                if part[k] < 0 and gaps[at, k] <= together[at, k]:
                    part[k], reached[left] = count, k
                    left += 1
        count += 1
    return part


@numba.njit(cache=True, nogil=True)
def _join(points, seeds, z_weight):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(M,) int32 the group of each point: that of the seed it is joined with by a minimum spanning forest (Prim).

    seeds: (M,) group of each seed, −1 for the other points.
    """
    group = seeds.copy()
    done = np.zeros(len(points), dtype=np.bool_)
    step2 = np.full(len(points), np.inf)
    for i in range(len(points)):
        if seeds[i] >= 0:
            step2[i] = 0.0
    for _ in range(len(points)):
        at, least = -1, np.inf
        for i in range(len(points)):
            if not done[i] and step2[i] < least:
                at, least = i, step2[i]
        if at < 0:
            break
        done[at] = True
        for i in range(len(points)):
            if done[i]:
                continue
            dx, dy = points[i, 0] - points[at, 0], points[i, 1] - points[at, 1]
            dz = z_weight * (points[i, 2] - points[at, 2])
            away2 = dx * dx + dy * dy + dz * dz
            if away2 < step2[i]:
                step2[i], group[i] = away2, group[at]
    return group


@numba.njit(cache=True, nogil=True)
def _measure_gaps(points, part, parts, rays_rad, z_weight):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(P, P) smallest distance between points of two parts, m; 0 if the last part continues the other without a gap of
    ``rays_rad`` in azimuth."""
    gaps = np.full((parts, parts), np.inf)
    azimuth, away = np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])
    for i in range(len(points)):
        for j in range(i):
            if part[i] != part[j]:
                dx, dy = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1]
                dz = z_weight * (points[i, 2] - points[j, 2])
                gap = np.sqrt(dx * dx + dy * dy + dz * dz)
                last, other = (i, j) if part[i] > part[j] else (j, i)
                continues = away[last] > away[other] - _STEP_M and abs(azimuth[i] - azimuth[j]) < rays_rad
                if continues and part[last] == parts - 1:
                    gap = 0.0
                if gap < gaps[part[i], part[j]]:
                    gaps[part[i], part[j]] = gaps[part[j], part[i]] = gap
    return gaps
