"""Exact Euclidean clustering with a weight on height (paper, Point Cloud Segmentation: "Euclidean clustering …").

Two points are joined when √(Δx² + Δy² + (z_weight·Δz)²) ≤ tolerance; a cluster is a connected component of that
relation. The weight is the paper's adaptation to few channels: a car seen by two rings 2° apart (0.7 m at 20 m) stays
one object. The paper uses a KD-tree; here, a grid gives the same partition (tests compare the two). The diagonal of its
cells equals the tolerance, so points in the same cell are joined without a test, and a union-find skips every pair of
cells that is joined already: near walls, where each point has hundreds of neighbours, cost almost nothing.

A tolerance that holds the bonnet and the roof of a far car together also joins a queue with the parked row 0.8 m beside
it. A cluster that is wider across the line of sight than any vehicle is therefore divided at smaller gaps. Along a
ring, the returns of one surface are centimetres apart, so a vehicle seen from the side stays whole.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from pipeline.lidar.ground import Ground, no_higher_than
from pipeline.params import ClusterParams
from pipeline.types import DROPPED, F32, F64, GROUND, I32, UNCLUSTERED, Mask

UNLABELLED = -1
WIDEST_M = 2.6
"""No vehicle's rear is wider (Directive 96/53/EC: 2.55 m, 2.60 m if refrigerated)."""


def candidates(points: F32, ground: Ground, keep: Mask, params: ClusterParams) -> Mask:
    """(N,) bool: kept points that may belong to an object: not ground, and at most ``max_height_m`` above it (bridges
    and signs are no obstacles). Without a fitted ground, all kept points."""
    return no_higher_than(ground, points, keep & ~ground.mask, params.max_height_m)


def cluster(points: F32, candidates: Mask, params: ClusterParams) -> I32:
    """(N,) int32 cluster of each point, −1 for none; clusters are numbered in order of their first point.

    points: (N, 4) float32 ``x y z intensity``, ego frame, finite. candidates: (N,) bool, the points to cluster. Of
    these, points beyond ``max_range_m`` (horizontally) are ignored, as are points behind the sensor with
    ``front_only``. Clusters of fewer than ``min_points`` or more than ``max_points`` are dropped.
    """
    chosen = _within(points, candidates, params.max_range_m, params.front_only)
    labels = np.full(len(points), UNLABELLED, dtype=np.int32)
    if len(chosen) == 0:
        return labels
    # slightly smaller than tolerance/√3, so that rounding cannot put two points that are too far apart into one cell
    cell_m = params.tolerance_m / np.sqrt(3.0) * (1.0 - 1e-6)
    xyz, column, level, shape = _cells(points, chosen, params.z_weight, cell_m)
    # np.zeros allocates lazily, so that a large empty grid costs nothing
    first_cell = np.zeros(shape[0] * shape[1], dtype=np.int32)
    roots = _components(xyz, column, level, first_cell, shape[1], params.tolerance_m)
    if params.divide_m < params.tolerance_m:
        _divide(points, chosen, roots, params)
    _number(roots, chosen, labels, params.min_points, params.max_points)
    return labels


def _divide(points: F32, chosen: I32, roots: I32, params: ClusterParams) -> None:
    """Splits components that are too wide for one vehicle by using the tolerance ``divide_m`` for their points; changes
    ``roots`` in place."""
    wide = np.flatnonzero(_is_wide(points, chosen, roots, WIDEST_M)).astype(np.int32)
    if not len(wide):
        return
    cell_m = params.divide_m / np.sqrt(3.0) * (1.0 - 1e-6)
    xyz, column, level, shape = _cells(points, chosen[wide], params.z_weight, cell_m)
    first_cell = np.zeros(shape[0] * shape[1], dtype=np.int32)
    roots[wide] = wide[_components(xyz, column, level, first_cell, shape[1], params.divide_m)]


@numba.njit(cache=True, nogil=True)
def _is_wide(points: F32, chosen: I32, roots: I32, widest_m: float) -> Mask:
    """(M,) bool: the angle of the point's component is larger than that of an object of this width at the component's
    nearest point."""
    low, high = np.full(len(roots), np.inf), np.full(len(roots), -np.inf)
    nearest = np.full(len(roots), np.inf)
    for k in range(len(roots)):
        x, y, root = points[chosen[k], 0], points[chosen[k], 1], roots[k]
        turn = np.arctan2(y, x)
        low[root], high[root] = min(low[root], turn), max(high[root], turn)
        nearest[root] = min(nearest[root], np.hypot(x, y))
    wide = np.zeros(len(roots), dtype=np.bool_)
    for k in range(len(roots)):
        wide[k] = (high[roots[k]] - low[roots[k]]) * nearest[roots[k]] > widest_m
    return wide


@numba.njit(cache=True, nogil=True)
def kinds(labels, keep, ground):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(N,) int32 classification of each point: its cluster, or ``GROUND``, ``UNCLUSTERED``, ``DROPPED``.

    labels: (N,) int32 as returned by ``cluster``. keep, ground: (N,) bool.
    """
    kind = labels.copy()
    for i in range(len(kind)):
        if kind[i] < 0:
            kind[i] = (GROUND if ground[i] else UNCLUSTERED) if keep[i] else DROPPED
    return kind


@numba.njit(cache=True, nogil=True)
def _within(points: F32, candidates: Mask, max_range_m: float, front_only: bool) -> I32:
    """Indices of the candidates in range. Branch-free, since the conditions vary from point to point and would be
    mispredicted."""
    chosen = np.empty(len(points) + 1, dtype=np.int32)
    count, limit2 = 0, max_range_m * max_range_m
    for i in range(len(points)):
        x, y = float(points[i, 0]), float(points[i, 1])
        chosen[count] = i
        count += candidates[i] & (x * x + y * y <= limit2) & ((x > 0.0) | (not front_only))
    return chosen[:count]


@numba.njit(cache=True, nogil=True)
def _cells(
    points: F32, chosen: I32, z_weight: float, cell_m: float
) -> tuple[F64, npt.NDArray[np.int64], I32, tuple[int, int]]:
    """xyz (M, 3) float64 with z weighted; the column and the level of each point; number of columns along x and y.

    Two empty columns surround the grid, so that neighbours need no bounds check.
    """
    xyz = np.empty((len(chosen), 3))
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for k in range(len(chosen)):
        for a in range(3):
            value = float(points[chosen[k], a])
            if a == 2:
                value *= z_weight
            xyz[k, a] = value
            low[a], high[a] = min(low[a], value), max(high[a], value)
    per_m = 1.0 / cell_m
    nx = int((high[0] - low[0]) * per_m) + 5
    ny = int((high[1] - low[1]) * per_m) + 5
    column = np.empty(len(chosen), dtype=np.int64)
    level = np.empty(len(chosen), dtype=np.int32)
    for k in range(len(chosen)):
        ix = int((xyz[k, 0] - low[0]) * per_m) + 2
        iy = int((xyz[k, 1] - low[1]) * per_m) + 2
        column[k] = ix * ny + iy
        level[k] = int((xyz[k, 2] - low[2]) * per_m)
    return xyz, column, level, (nx, ny)


@numba.njit(cache=True, nogil=True)
def _components(
    xyz: F64, column: npt.NDArray[np.int64], level: I32, first_cell: I32, ny: int, tolerance_m: float
) -> I32:
    """(M,) the first point of each point's component. ``first_cell`` is the grid, all zeros on entry: for each column,
    one plus the number of its newest cell. The cells of a column form a linked list."""
    count = len(xyz)
    cell_of = np.empty(count, dtype=np.int32)
    below = np.empty(count, dtype=np.int32)  # the next cell of the same column, −1 at the end
    cell_column = np.empty(count, dtype=np.int64)
    cell_level = np.empty(count, dtype=np.int32)
    size = np.zeros(count + 1, dtype=np.int32)
    cells, c = 0, -1
    for k in range(count):
        if k > 0 and column[k] == column[k - 1] and level[k] == level[k - 1]:  # usually the next point of the same beam
            cell_of[k] = c
            size[c] += 1
            continue
        c = first_cell[column[k]] - 1
        while c >= 0 and cell_level[c] != level[k]:
            c = below[c]
        if c < 0:
            c, cells = cells, cells + 1
            below[c] = first_cell[column[k]] - 1
            cell_column[c], cell_level[c] = column[k], level[k]
            first_cell[column[k]] = c + 1
        cell_of[k] = c
        size[c] += 1
    start = np.zeros(cells + 1, dtype=np.int32)
    for c in range(cells):
        start[c + 1] = start[c] + size[c]
    place = start[:-1].copy()
    by_cell = np.empty(count, dtype=np.int32)
    for k in range(count):  # stable order: a cell's first entry is its first point
        by_cell[place[cell_of[k]]] = k
        place[cell_of[k]] += 1
    packed = np.empty((count, 3))
    for j in range(count):
        packed[j, 0], packed[j, 1], packed[j, 2] = xyz[by_cell[j], 0], xyz[by_cell[j], 1], xyz[by_cell[j], 2]

    bounds = _bounds(packed, start)
    parent = np.arange(cells).astype(np.int32)
    limit2 = tolerance_m * tolerance_m
    for c in range(cells):
        mine = _root(parent, c)
        for dx in range(3):
            for dy in range(-2 if dx > 0 else 0, 3):  # half of the neighbours suffices by symmetry
                other = first_cell[cell_column[c] + dx * ny + dy] - 1
                while other >= 0:
                    if abs(cell_level[other] - cell_level[c]) <= 2:
                        theirs = _root(parent, other)
                        if mine != theirs and _touch(packed, start, bounds, c, other, limit2):
                            mine, theirs = min(mine, theirs), max(mine, theirs)
                            parent[theirs] = mine
                    other = below[other]
    # cells are numbered by their first points, so the lowest cell of a component contains its first point
    roots = np.empty(count, dtype=np.int32)
    for k in range(count):
        roots[k] = by_cell[start[_root(parent, cell_of[k])]]
    return roots


@numba.njit(cache=True, nogil=True)
def _root(parent: I32, c: int) -> int:
    """The lowest cell joined with ``c``; halves the path on the way."""
    while parent[c] != c:
        parent[c] = parent[parent[c]]
        c = parent[c]
    return c


@numba.njit(cache=True, nogil=True)
def _bounds(packed: F64, start: I32) -> F64:
    """(C, 6) minimum and maximum x, y, z of each cell's points."""
    bounds = np.empty((len(start) - 1, 6))
    for c in range(len(bounds)):
        for axis in range(3):
            low = high = packed[start[c], axis]
            for j in range(start[c] + 1, start[c + 1]):
                low, high = min(low, packed[j, axis]), max(high, packed[j, axis])
            bounds[c, axis], bounds[c, axis + 3] = low, high
    return bounds


@numba.njit(cache=True, nogil=True)
def _touch(packed: F64, start: I32, bounds: F64, c: int, other: int, limit2: float) -> bool:
    """Whether any point of one cell is within the tolerance of any point of the other. Most pairs are ruled out early:
    a point that is too far from a cell's bounds is too far from all its points."""
    dx = max(bounds[other, 0] - bounds[c, 3], bounds[c, 0] - bounds[other, 3], 0.0)
    dy = max(bounds[other, 1] - bounds[c, 4], bounds[c, 1] - bounds[other, 4], 0.0)
    dz = max(bounds[other, 2] - bounds[c, 5], bounds[c, 2] - bounds[other, 5], 0.0)
    if dx * dx + dy * dy + dz * dz > limit2:
        return False
    for a in range(start[c], start[c + 1]):
        x, y, z = packed[a, 0], packed[a, 1], packed[a, 2]
        dx = max(bounds[other, 0] - x, x - bounds[other, 3], 0.0)
        dy = max(bounds[other, 1] - y, y - bounds[other, 4], 0.0)
        dz = max(bounds[other, 2] - z, z - bounds[other, 5], 0.0)
        if dx * dx + dy * dy + dz * dz > limit2:
            continue
        for b in range(start[other], start[other + 1]):
            dx, dy, dz = x - packed[b, 0], y - packed[b, 1], z - packed[b, 2]
            if dx * dx + dy * dy + dz * dz <= limit2:
                return True
    return False


@numba.njit(cache=True, nogil=True)
def _number(roots: I32, chosen: I32, labels: I32, min_points: int, max_points: int) -> None:
    """Writes 0, 1, … into ``labels`` for components of an accepted size, in order of their first point."""
    size = np.zeros(len(roots), dtype=np.int32)
    for k in range(len(roots)):
        size[roots[k]] += 1
    name = np.full(len(roots), -1, dtype=np.int32)
    count = 0
    for k in range(len(roots)):
        if min_points <= size[roots[k]] <= max_points:
            if name[roots[k]] < 0:
                name[roots[k]] = count
                count += 1
            labels[chosen[k]] = name[roots[k]]
