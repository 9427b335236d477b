"""The compiled loops behind ``cluster``: a grid of cells in which all points are joined, and a union-find over the
cells that are near each other."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from pipeline.types import F32, F64, I32


@numba.njit(cache=True, nogil=True)
def cells(
    points: F32, chosen: I32, z_weight: float, cell_m: float, reach: int
) -> tuple[F64, npt.NDArray[np.int64], I32, tuple[int, int]]:
    """xyz (M, 3) float64 with z weighted; the column and the level of each point; number of columns along x and y.

    ``reach`` empty columns surround the grid, so that neighbours need no bounds check.
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
    nx = int((high[0] - low[0]) * per_m) + 2 * reach + 1
    ny = int((high[1] - low[1]) * per_m) + 2 * reach + 1
    column = np.empty(len(chosen), dtype=np.int64)
    level = np.empty(len(chosen), dtype=np.int32)
    for k in range(len(chosen)):
        ix = int((xyz[k, 0] - low[0]) * per_m) + reach
        iy = int((xyz[k, 1] - low[1]) * per_m) + reach
        column[k] = ix * ny + iy
        level[k] = int((xyz[k, 2] - low[2]) * per_m)
    return xyz, column, level, (nx, ny)


@numba.njit(cache=True, nogil=True)
def components(
    xyz: F64,
    column: npt.NDArray[np.int64],
    level: I32,
    first_cell: I32,
    ny: int,
    cell_m: float,
    fine_m: float,
    coarse_m: float,
    reach: int,
) -> tuple[I32, I32]:
    """(M,) twice: the first point of each point's component, for the fine and for the coarse tolerance. The diagonal of
    the cells is the fine one; ``reach`` cells are as long as the coarse one. ``first_cell`` is the grid, all zeros on
    entry: for each column, one plus the number of its newest cell. The cells of a column form a linked list."""
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

    offsets = _offsets(ny, cell_m, coarse_m, reach)
    pairs = np.empty((cells * 24 + 2, 3), dtype=np.int32)
    count = _pairs(first_cell, offsets, cell_column[:cells], cell_level, below, reach, pairs)
    if count >= len(pairs):
        pairs = np.empty((count + 1, 3), dtype=np.int32)
        count = _pairs(first_cell, offsets, cell_column[:cells], cell_level, below, reach, pairs)
    pairs = pairs[:count]
    bounds = _bounds(packed, start)
    parent = np.arange(cells).astype(np.int32)
    # near cells first: they join most of the farther ones, which then need no test
    _join(parent, pairs, packed, start, bounds, fine_m, 0, 1)
    _join(parent, pairs, packed, start, bounds, fine_m, 2, 2)
    fine = _first_points(parent, cell_of, by_cell, start)
    if coarse_m <= fine_m:
        return fine, fine.copy()
    _join(parent, pairs, packed, start, bounds, coarse_m, 0, reach)
    return fine, _first_points(parent, cell_of, by_cell, start)


@numba.njit(cache=True, nogil=True)
def _offsets(ny: int, cell_m: float, tolerance_m: float, reach: int) -> npt.NDArray[np.int64]:
    """(K, 2) of each neighbouring column that may have points within the tolerance: how far it is in the grid, and how
    many columns away. By symmetry, half of them suffice."""
    offsets, count = np.empty(((reach + 1) * (2 * reach + 1), 2), dtype=np.int64), 0
    for dx in range(reach + 1):
        for dy in range(-reach if dx > 0 else 0, reach + 1):
            gap_x, gap_y = max(dx - 1, 0) * cell_m, max(abs(dy) - 1, 0) * cell_m
            if gap_x * gap_x + gap_y * gap_y <= tolerance_m * tolerance_m * (1.0 + 1e-6):  # whatever rounding does
                offsets[count, 0], offsets[count, 1] = dx * ny + dy, max(dx, abs(dy))
                count += 1
    return offsets[:count]


@numba.njit(cache=True, nogil=True)
def _pairs(first_cell, offsets, cell_column, cell_level, below, reach, pairs):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Writes each pair of cells that are at most ``reach`` columns and levels apart, and by how many, into ``pairs``
    (P, 3). Returns the number of pairs, which may be larger than P."""
    count, most = 0, len(pairs) - 1
    for c in range(len(cell_column)):
        column, level = cell_column[c], cell_level[c]
        for k in range(len(offsets)):
            other = first_cell[column + offsets[k, 0]] - 1
            while other >= 0:
                apart = max(offsets[k, 1], abs(cell_level[other] - level))
                row = min(count, most)
                pairs[row, 0], pairs[row, 1], pairs[row, 2] = c, other, apart
                count += int(apart <= reach)
                other = below[other]
    return count


@numba.njit(cache=True, nogil=True)
def _join(parent, pairs, packed, start, bounds, tolerance_m, nearest, farthest):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Joins all pairs of cells that are ``nearest`` to ``farthest`` apart and have points within the tolerance of each
    other; changes ``parent`` in place."""
    limit2 = tolerance_m * tolerance_m
    joined = np.empty_like(parent)
    for c in range(len(parent)):  # what was joined before needs no search
        joined[c] = _root(parent, c)
    for k in range(len(pairs)):
        a, b = pairs[k, 0], pairs[k, 1]
        if joined[a] != joined[b] and nearest <= pairs[k, 2] <= farthest:
            mine, theirs = _root(parent, a), _root(parent, b)
            if mine != theirs and _touch(packed, start, bounds, a, b, limit2):
                parent[max(mine, theirs)] = min(mine, theirs)


@numba.njit(cache=True, nogil=True)
def _first_points(parent: I32, cell_of: I32, by_cell: I32, start: I32) -> I32:
    """(M,) the first point of each point's component. Cells are numbered by their first points, so the lowest cell of a
    component contains its first point."""
    first = np.empty(len(parent), dtype=np.int32)
    for c in range(len(parent)):
        first[c] = by_cell[start[_root(parent, c)]]
    return first[cell_of]


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
    """Whether any point of one cell is within the tolerance of any point of the other. Most pairs are decided by their
    bounds: a point that is too far from a cell's bounds is too far from all its points, and cells whose bounds lie
    within the tolerance need no test of points."""
    dx = max(bounds[other, 0] - bounds[c, 3], bounds[c, 0] - bounds[other, 3], 0.0)
    dy = max(bounds[other, 1] - bounds[c, 4], bounds[c, 1] - bounds[other, 4], 0.0)
    dz = max(bounds[other, 2] - bounds[c, 5], bounds[c, 2] - bounds[other, 5], 0.0)
    if dx * dx + dy * dy + dz * dz > limit2:
        return False
    dx = max(bounds[other, 3] - bounds[c, 0], bounds[c, 3] - bounds[other, 0])
    dy = max(bounds[other, 4] - bounds[c, 1], bounds[c, 4] - bounds[other, 1])
    dz = max(bounds[other, 5] - bounds[c, 2], bounds[c, 5] - bounds[other, 2])
    if dx * dx + dy * dy + dz * dz <= limit2:
        return True
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
