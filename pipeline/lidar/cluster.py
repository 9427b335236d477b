"""Exact Euclidean clustering with a weight on height (paper, Point Cloud Segmentation: "Euclidean clustering …").

Two points are joined when √(Δx² + Δy² + (z_weight·Δz)²) ≤ tolerance; a cluster is a connected component of that
relation. The weight is the paper's adaptation to few channels: a car seen by two rings 2° apart (0.7 m at 20 m) stays
one object. The paper uses a KD-tree; here, a grid gives the same partition (tests compare the two). The diagonal of its
cells equals the tolerance, so points in the same cell are joined without a test, and a union-find skips every pair of
cells that is joined already: near walls, where each point has hundreds of neighbours, cost almost nothing.

A tolerance that holds the bonnet and the roof of a far car together also joins a queue with the parked row 0.8 m beside
it. A cluster that is wider across the line of sight than any vehicle is therefore divided at smaller gaps. Along a
ring, the returns of one surface are centimetres apart, so a vehicle seen from the side stays whole. Most points of a
street belong to such clusters, so both partitions are made at once, on one grid: the fine one, then the coarse one from
its components.
"""

from __future__ import annotations

import numba
import numpy as np

from pipeline.lidar import cluster_kernels as kernels
from pipeline.lidar.ground import Ground, no_higher_than
from pipeline.params import ClusterParams
from pipeline.types import DROPPED, F32, GROUND, I32, UNCLUSTERED, Mask

UNLABELLED = -1
WIDEST_M = 2.6
"""No vehicle's rear is wider (Directive 96/53/EC: 2.55 m, 2.60 m if refrigerated)."""


_ONE_GRID = 2.0
"""Up to this ratio of the two tolerances, cells for the smaller one serve both: each has few neighbours."""


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
    fine_m = min(params.divide_m, params.tolerance_m)
    if params.tolerance_m <= _ONE_GRID * fine_m:
        fine, roots = _partitions(points, chosen, params.z_weight, fine_m, params.tolerance_m)
    else:
        fine, _ = _partitions(points, chosen, params.z_weight, fine_m, fine_m)
        roots, _ = _partitions(points, chosen, params.z_weight, params.tolerance_m, params.tolerance_m)
    if fine_m < params.tolerance_m:
        _divide(points, chosen, roots, fine, WIDEST_M)
    _number(roots, chosen, labels, params.min_points, params.max_points)
    return labels


def _partitions(points: F32, chosen: I32, z_weight: float, fine_m: float, coarse_m: float) -> tuple[I32, I32]:
    """(M,) twice: for the fine and for the coarse tolerance, the first point of the component of each chosen point."""
    # slightly smaller than tolerance/√3, so that rounding cannot put two points that are too far apart into one cell
    cell_m = fine_m / np.sqrt(3.0) * (1.0 - 1e-6)
    reach = int(np.ceil(coarse_m / cell_m))
    xyz, column, level, shape = kernels.cells(points, chosen, z_weight, cell_m, reach)
    # np.zeros allocates lazily, so that a large empty grid costs nothing
    first_cell = np.zeros(shape[0] * shape[1], dtype=np.int32)
    return kernels.components(xyz, column, level, first_cell, shape[1], cell_m, fine_m, coarse_m, reach)


@numba.njit(cache=True, nogil=True)
def _divide(points: F32, chosen: I32, roots: I32, fine: I32, widest_m: float) -> None:
    """Splits components that are too wide for one vehicle into their ``fine`` components; changes ``roots`` in place.

    A component is too wide if its angle is larger than that of an object of this width at its nearest point. Of the
    points, only the leftmost and the rightmost need an arctangent: a cheaper number grows with the angle, too.
    """
    count = len(roots)
    low, high, nearest2 = np.full(count, np.inf), np.full(count, -np.inf), np.full(count, np.inf)
    first, last = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)
    for k in range(count):
        x, y, root = float(points[chosen[k], 0]), float(points[chosen[k], 1]), roots[k]
        nearest2[root] = min(nearest2[root], x * x + y * y)
        turn = 1.0 - x / max(abs(x) + abs(y), 1e-9)
        if y < 0.0:
            turn = -turn
        if turn < low[root]:
            low[root], first[root] = turn, chosen[k]
        if turn > high[root]:
            high[root], last[root] = turn, chosen[k]
    wide = np.zeros(count, dtype=np.bool_)
    for k in range(count):
        if roots[k] == k:
            angle = _turn(points, last[k]) - _turn(points, first[k])
            wide[k] = angle * np.sqrt(nearest2[k]) > widest_m
    for k in range(count):
        if wide[roots[k]]:
            roots[k] = fine[k]


@numba.njit(cache=True, nogil=True)
def _turn(points: F32, i: int) -> float:
    return np.arctan2(float(points[i, 1]), float(points[i, 0]))


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
