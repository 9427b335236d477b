"""Structure beside the road, as cells on the ground: kerbs, hedges, walls, rails, and parked cars as a row.

One sweep of 16 rings shows little of an edge: a kerb on two rings, or the nearest corners of a row of parked cars.
Cells of earlier sweeps, moved by ego motion, complete it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import cv2
import numba
import numpy as np

from pipeline.common.made_sweep import made_sweep
from pipeline.path import vanished
from pipeline.path.ground_points import now_at
from pipeline.types import F32, F64, GROUND, I32, I64, U8, VEHICLES, EgoState, FusedObject, Ground, Point3
from pipeline.types.arrays import Mask
from pipeline.types.ground_planes import height_above

REACH_M, ASIDE_M = 48.0, 24.0
"""Farther ahead or to the side, a 16-channel LiDAR does not resolve a road's edge."""
_BEHIND_M = -8.0
CELL_M = 0.5
"""One vote per cell: otherwise near structure, where rings are dense, would outvote everything far away."""
_LOW_M, _HIGH_M = 0.3, 2.5
"""Height range: above the road's unevenness, below the crowns of trees."""
_STEP_M, _STEP_MOST_M = 0.05, 0.25
"""Height of a kerb: from a lowered kerb up to the height from which structure counts as standing."""
_FLAT_M, _FLAT_SHARE = 0.02, 0.05
"""A stretch of a ring is level if its heights vary by at most the road's roughness over this share of its range."""
_SLANT, _SLACK_M = 1.5, 0.4
"""A ring that climbs by h comes nearer by h/H of its range, where H is the sensor's height above the road, and covers a
corresponding length. If it covers more, it is the crown of the road, not a kerb."""
_KERBS_TO_M = 30.0
_KEPT_S = 2.5
"""During this time, own motion keeps a cell's position as accurate as it was measured: 1 % of 25 m, and 0.5° of
heading."""
_DRIVES_MPS = 4.0
"""If only the LiDAR sees an object move, it may be a hedge that becomes visible bit by bit; above this speed it is a
vehicle."""
_LONG_M = 6.0
_MARGIN_M, _SIGMAS = 0.8, 2.0
_BLOCKED, _PERHAPS_A_LEAD = 4.0, 1.5
"""Log-likelihoods. Nobody drives through a hedge. A car in the way may be parked in a bend or may be a lead; a kerb may
be the crown of the road."""


class Cells(NamedTuple):
    """Grid cells that contain structure."""

    xy: F64
    """(M, 2) ego x, y."""
    blocks: F64
    """(M,) log-likelihood of each cell that no road leads through it."""
    age_s: F64
    """(M,) time since each cell was last seen."""
    stands: Mask
    """(M,) bool, whether it is standing structure; a kerb is not."""
    z_m: F64
    """(M,) ego z of the return that each was made of; NaN for a kerb, which rays pass over anyway."""


NONE = Cells(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0, np.bool_), np.zeros(0))


def moved(cells: Cells, ego: EgoState, dt_s: float) -> Cells:
    """Current positions of the cells of ``dt_s`` ago, without those too old or too far behind."""
    xy = now_at(cells.xy, ego, dt_s)
    age_s = cells.age_s + dt_s
    keep = (xy[:, 0] > _BEHIND_M) & (age_s <= _KEPT_S)
    return _only(cells._replace(xy=xy, age_s=age_s), keep)


def seen(points: F32, kind: I32, ring: U8, ground: Ground, long: Sequence[int], height_m: float) -> Cells:
    """Cells of one sweep.

    Args:
        points: (N, 4) of the sweep.
        kind: (N,) classification of each point; ≥ 0 the number of its cluster.
        ring: (N,) the channel of each point.
        ground: the road below them.
        long: clusters that are too long for a car.
        height_m: of the sensor above the road.
    """
    is_long = np.zeros(int(kind.max(initial=0)) + 1, np.bool_)
    is_long[list(long)] = True
    standing, blocks, low, low_ring, low_above = _sorted(points, kind, ring, ground.planes, ground.edges, is_long)
    kerbs = _kerbs(low, low_ring, low_above, height_m)
    count = len(standing) + len(kerbs)
    return Cells(
        np.concatenate([standing[:, :2], kerbs]),
        np.concatenate([blocks, np.full(len(kerbs), _PERHAPS_A_LEAD)]),
        np.zeros(count),
        np.arange(count) < len(standing),
        np.concatenate([standing[:, 2], np.full(len(kerbs), np.nan)]),
    )


def merged(before: Cells, fresh: Cells) -> Cells:
    """All cells, one per square of the grid; fresh cells have priority."""
    both = Cells(*(np.concatenate(pair) for pair in zip(fresh, before, strict=True)))
    if not len(both.xy):
        return NONE
    at = np.floor(both.xy / CELL_M).astype(np.int64)
    _, first = np.unique(at[:, 0] * 100_003 + at[:, 1], return_index=True)
    return _only(both, first)


def standing(cells: Cells, points: F32, ring: U8, origin: Point3, height_m: float) -> Cells:
    """The cells without those through which rays of this sweep passed. origin: ego x y z of the sensor, ``height_m``
    above the road."""
    gone = vanished.is_gone(cells.xy, cells.z_m, points, ring, origin, height_m, CELL_M)
    return _only(cells, ~gone) if gone.any() else cells


def without(cells: Cells, objects: Sequence[FusedObject]) -> Cells:
    """The cells that are not in or directly beside any of the objects; a camera-only one may be as much nearer or
    farther as its distance is uncertain."""
    rows = [
        (*chain(*item.bev), _MARGIN_M + (0.0 if item.ranged else _SIGMAS * (item.distance_sigma_m or 0.0)))
        for item in objects
        if item.bev is not None
    ]
    if not rows or not len(cells.xy):
        return cells
    return _only(cells, _is_beside_none(np.ascontiguousarray(cells.xy), np.array(rows), _MARGIN_M))


def thinned(cells: Cells) -> Cells:
    """As many cells of each compact object as its length has room for.

    Only what runs along the road shows its shape, and the more the longer it is. All cells of two bushes would claim
    that the road leads past both at the same distance, each of them as if it had seen that for itself.
    """
    if not len(cells.xy):
        return cells

    at = np.floor(cells.xy / CELL_M).astype(np.int64)
    at -= at.min(axis=0)
    taken = np.zeros(at.max(axis=0) + 1, np.uint8)
    taken[at[:, 0], at[:, 1]] = 1
    number = cv2.connectedComponents(taken, connectivity=8)[1][at[:, 0], at[:, 1]] - 1
    order = np.lexsort((at[:, 1], at[:, 0], number))
    count = np.bincount(number)
    first = np.cumsum(count) - count
    low, high = (by.reduceat(at[order], first, axis=0) for by in (np.minimum, np.maximum))
    room = np.minimum(count, np.rint(np.hypot(*(high - low).T)).astype(np.int64) + 1)
    rank = np.arange(len(order)) - np.repeat(first, count)
    share = np.repeat(room / count, count)
    # evenly over the object: a cell is kept where the running number of kept ones reaches the next whole number
    keep = np.floor((rank + 1) * share + 1e-9) > np.floor(rank * share + 1e-9)
    return _only(cells, np.sort(order[keep]))


def _only(cells: Cells, keep: Mask | I64) -> Cells:
    """The cells that a mask or indices select."""
    xy, blocks, age_s, stands, z_m = cells
    return Cells(xy[keep], blocks[keep], age_s[keep], stands[keep], z_m[keep])


def drives(item: FusedObject) -> bool:
    """Whether the object is certainly a moving vehicle."""
    if not item.surely_moving or (item.speed_over_ground_mps or 0.0) < _DRIVES_MPS:
        return False
    return item.label in VEHICLES or (item.cuboid is not None and max(item.cuboid.size[:2]) < _LONG_M)


def comes(item: FusedObject) -> bool:
    """Whether the camera's vehicle comes towards the car, as far as its speed is known by now. Until that is certain,
    the flank of an oncoming bus looks like an edge that runs across our lane."""
    return bool(item.oncoming) and item.label in VEHICLES and (item.speed_over_ground_mps or 0.0) >= _DRIVES_MPS


def long(objects: Sequence[FusedObject], cluster_of: dict[int, int]) -> list[int]:
    """Clusters that are too long for a car: hedges, walls, rails."""
    return [
        cluster_of[item.lidar_track]
        for item in objects
        if item.lidar_track in cluster_of
        and item.cuboid is not None
        and max(item.cuboid.size[:2]) > _LONG_M
        and item.label not in VEHICLES
    ]


def _kerbs(xy: F64, ring: U8, above: F64, height_m: float) -> F64:
    """(M, 2) points on kerbs: between a level stretch of a ring and the next one that is higher or lower by a kerb's
    height. A ring crosses a kerb at an angle, so the points in between lie along the kerb. xy: (N, 2) points near the
    ground, ring by ring, within a ring in the order of measurement."""
    slant = _SLANT / height_m
    on_kerb = _between_levels(xy, ring, above, _FLAT_M, _FLAT_SHARE, _STEP_M, _STEP_MOST_M, slant, _SLACK_M)
    return np.asarray(xy[on_kerb])


def warm_up() -> None:
    """Compile the kernels, or load them from numba's cache; import what is imported on use."""
    planes, edges, kind = np.array([[0.0, 0.0, 1.0, 0.0]]), np.array([0.0, 1.0]), np.zeros(2, np.int32)
    points, ring = made_sweep()
    _, _, low, low_ring, low_above = _sorted(points, kind, ring, planes, edges, np.zeros(1, np.bool_))
    _kerbs(low, low_ring, low_above, 1.0)
    _is_beside_none(np.zeros((1, 2)), np.zeros((1, 9)), _MARGIN_M)
    thinned(Cells(np.zeros((1, 2)), np.zeros(1), np.zeros(1), np.zeros(1, np.bool_), np.zeros(1)))
    vanished.warm_up()


@numba.njit(cache=True, nogil=True)
def _is_beside_none(xy, rows, margin_m):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(M,) bool, which of the places (M, 2) are beside and in none of the footprints (N, 9): x y of the four corners,
    and how far before and behind it a place counts as beside it."""
    keep = np.ones(len(xy), np.bool_)
    for row in rows:
        ahead_x, ahead_y = row[0] - row[6], row[1] - row[7]
        length, width = np.hypot(ahead_x, ahead_y), np.hypot(row[0] - row[2], row[1] - row[3])
        c, s = ahead_x / max(length, 1e-6), ahead_y / max(length, 1e-6)
        x, y = (row[0] + row[2] + row[4] + row[6]) / 4.0, (row[1] + row[3] + row[5] + row[7]) / 4.0
        for n in range(len(xy)):
            dx, dy = xy[n, 0] - x, xy[n, 1] - y
            along, across = abs(dx * c + dy * s), abs(dy * c - dx * s)
            keep[n] &= along > length / 2 + row[8] or across > width / 2 + margin_m
    return keep


@numba.njit(cache=True, nogil=True)
def _sorted(points, kind, ring, planes, edges, is_long):  # type: ignore[no-untyped-def]  # pragma: no cover
    """The points near the car that may show an edge. is_long: by number of a cluster, whether it is too long for a car.

    Returns (A, 3) ego x, y, z of standing points and their log-likelihood that no road leads through them (A,); then
    (B, 2) ego x, y of points near the ground, their ring (B,) and height (B,), ring by ring.
    """
    count, standing, low = len(points), 0, 0
    places, blocks = np.empty((count, 3)), np.empty(count)
    rows, above = np.empty(count, np.int64), np.empty(count)
    starts = np.zeros(257, np.int64)
    for n in range(count):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        if not (x > 0.0 and x < REACH_M and abs(y) < ASIDE_M):
            continue
        height_m = height_above(planes, edges, x, y, z)
        if height_m > _LOW_M and height_m < _HIGH_M and kind[n] != GROUND:
            places[standing, 0], places[standing, 1], places[standing, 2] = x, y, z
            blocks[standing] = _BLOCKED if kind[n] >= 0 and is_long[kind[n]] else _PERHAPS_A_LEAD
            standing += 1
        elif height_m < _LOW_M and x < _KERBS_TO_M:
            rows[low], above[low] = n, height_m
            starts[ring[n] + 1] += 1
            low += 1
    for r in range(256):
        starts[r + 1] += starts[r]
    low_xy, low_ring, low_above = np.empty((low, 2)), np.empty(low, np.uint8), np.empty(low)
    for k in range(low):
        n = rows[k]
        at = starts[ring[n]]
        starts[ring[n]] += 1
        low_xy[at, 0], low_xy[at, 1] = points[n, 0], points[n, 1]
        low_ring[at], low_above[at] = ring[n], above[k]
    return places[:standing].copy(), blocks[:standing].copy(), low_xy, low_ring, low_above


@numba.njit(cache=True, nogil=True)
def _between_levels(xy, ring, above, flat_m, flat_share, step, most, slant, slack):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(N,) bool, which points lie between two level stretches of their ring that differ by a kerb's height."""
    out = np.zeros(len(xy), np.bool_)
    first, last_end, last_level = 0, -1, 0.0
    while first < len(xy):
        low = high = total = above[first]
        end = first
        while end + 1 < len(xy) and ring[end + 1] == ring[first]:
            low_with, high_with = min(low, above[end + 1]), max(high, above[end + 1])
            if high_with - low_with > flat_m:
                break
            low, high, total = low_with, high_with, total + above[end + 1]
            end += 1
        far = np.hypot(xy[first, 0], xy[first, 1])
        span = np.hypot(xy[end, 0] - xy[first, 0], xy[end, 1] - xy[first, 1])
        if end - first < 4 or span < flat_share * far:
            if end + 1 < len(xy) and ring[end + 1] != ring[first] and end == first:
                last_end = -1
            first += 1
            continue
        level = total / (end - first + 1)
        if last_end >= 0 and ring[last_end] == ring[first]:
            gap = np.hypot(xy[first, 0] - xy[last_end, 0], xy[first, 1] - xy[last_end, 1])
            if step < abs(level - last_level) < most and gap < slack + slant * abs(level - last_level) * far:
                out[last_end : first + 1] = True
        last_end, last_level = end, level
        first = end + 1
    return out
