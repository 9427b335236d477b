"""Divides clusters that cover two tracked vehicles, using the tracks' predictions.

A cluster shows only one moment. A lead that stands or passes 0.7 m beside a parked car merges with it, because returns
of a single car can be as far apart. The tracks, which were followed while the vehicles were apart, can tell. Two tracks
are two vehicles if they move apart, because the parts of a rigid body share its velocity, or if together they are wider
than any vehicle and leave a gap that no surface has.

One track is enough if its vehicle is narrower than the cluster: a rigid body does not widen, so returns beside the
lateral extent that it had over the last second belong to something that no track follows yet, as when the next parked
car comes into view beside a bus. Nor does it grow towards us: returns before the rear of a vehicle that drives ahead
are those of a parked car that it passes. Here too, the two must leave a gap, or else a side of the vehicle came into
view. In a cluster that is no wider than a vehicle may be, that is not enough: the returns of a flank seen at a grazing
angle are metres apart, but in neighbouring rays. What rays pass beside, or what is nearer, is something else.

Returns within an expected footprint are its seeds. Every other return of the cluster joins the seeds that it is linked
with by the shortest steps (a minimum spanning forest, like a watershed): a side that comes into view joins its rear,
which it is connected to by returns centimetres apart, whatever is beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pipeline.common import kalman
from pipeline.lidar import divide_kernels as kernels
from pipeline.lidar.cluster import WIDEST_M
from pipeline.lidar.track_history import steady_sides
from pipeline.params import ClusterParams
from pipeline.types import F32, F64, I32, I64, LidarTrack, Mask

MIN_HITS = 5
"""Sightings of a track, half a second at 10 Hz, before a cluster is divided for it. By then its velocity has converged.
"""
_APART_MPS, _APART_SIGMAS = 2.0, 3.0
"""Two tracks move apart if their velocities differ by more than both limits. The reference point of a footprint that
grows while we pass moves at up to 1–2 m/s."""
_GAP_M, _GAP_RAD = 0.3, np.radians(0.6)
"""Neighbouring returns of one surface are closer: along a ring of a VLP-16 0.1 m at 28 m, twice that where it is
down-sampled. Farther away, three of its rays are wider than that."""
_NEARER_M, _CLOSING_MPS = 0.5, 5.0
"""A vehicle that drives ahead ends at its rear: what is nearer than that by the first, and not connected to it, is
something else, such as the flank of the parked car that it passes. Two standard deviations of a cluster's position are
0.3 m. Of a vehicle that comes nearer by more than the second, a new side may come into view."""
_DIRECTIONS = np.radians(np.arange(0.0, 180.0, 5.0))
_LEAST_SEEDS = 2
"""A single return may be an outlier."""
_CELL_M = 0.08
"""Returns closer together than about this are joined as one: near the car a ring has one every centimetre."""
_MOST_CELLS = 1000
"""Limit for one cluster to be divided. Joining takes quadratic time: 2.4 ms for this many, 35 ms for 4,000."""


class _Expected(NamedTuple):
    """Tracks that a cluster may be divided for, at their positions predicted for now."""

    footprints: F64
    """(T, 6) x, y, half length, half width, cos and sin of the yaw."""
    velocity: F64
    """(T, 2) m/s."""
    variance: F64
    """(T,) variance of the velocity, both axes."""


def divide(
    points: F32,
    labels: I32,
    tracks: Sequence[LidarTrack],
    filters: kalman.CvState,
    history: F64,
    dt_s: float | None,
    params: ClusterParams,
) -> I32:
    """(N,) int32 labels as returned by ``cluster``, with a separate label for each vehicle that shared a cluster.

    points: (N, 4) float32 ``x y z intensity``, ego frame. labels: (N,) int32. tracks, filters, history: tracks of the
    previous sweep, their constant-velocity filters and their sightings (T, H, 5), in the same order. dt_s: time since
    then; None at a start. A part of a divided cluster is merged into the cluster that contains most of its track, so
    that a flank is not cut off from its rear.
    """
    count = int(labels.max(initial=-1)) + 1
    known = [n for n, each in enumerate(tracks) if each.hits >= MIN_HITS and each.velocity_mps is not None]
    if not params.divide_tracked or dt_s is None or not known or count == 0:
        return labels
    expected = _expect([tracks[n] for n in known], filters.cov[known], dt_s)
    now_s = np.nanmax(history[:, :, 0]) + dt_s
    sides = steady_sides(history[known], now_s, WIDEST_M)
    likely = steady_sides(history[known], now_s, WIDEST_M, 0.0)
    # only clusters near two or more tracks, or wider or nearer than the one they are near, and what else is near these
    reached, low, high = kernels.reach_clusters(points, labels, expected.footprints, count)
    nearest = _nearest(expected, params)
    narrow = reached & (np.diff(sides) < WIDEST_M)
    wide = high[:, 1] - low[:, 1] > WIDEST_M
    beyond_m = np.maximum(likely[:, :1] - low[:, 1], high[:, 1] - likely[:, 1:])
    grown = wide | (low[:, 0] < nearest[:, None]) | (beyond_m > kernels.AROUND_M)
    widened = np.any(narrow & grown, axis=0)
    involved = np.any(reached[:, (reached.sum(axis=0) >= 2) | widened], axis=1, keepdims=True)
    if not np.any(involved):
        return labels
    owner = kernels.find_owners(points, labels, expected.footprints, sides, likely, nearest, reached & involved, wide)
    seeds = kernels.count_seeds(labels, owner, len(known), count)
    beside = np.bincount(labels[(labels >= 0) & (owner == kernels.OUTSIDE)], minlength=count)
    outside = beside >= np.where(wide, _LEAST_SEEDS, 1)
    sharing = (seeds >= _LEAST_SEEDS).sum(axis=0)
    pieces, parts = labels.copy(), []
    for which in np.flatnonzero((sharing >= 2) | ((sharing == 1) & widened & outside)).tolist():
        present = np.flatnonzero(seeds[:, which] >= _LEAST_SEEDS)
        members = np.flatnonzero(labels == which)
        rays_rad = 0.0 if wide[which] else _GAP_RAD
        part = _parts(points[members], owner[members], present, bool(widened[which]), rays_rad, expected, params)
        if part is not None:
            numbers = np.concatenate([[which], pieces.max() + np.arange(1, part.max() + 1)]).astype(np.int32)
            pieces[members] = numbers[part]
            parts.append((bool(wide[which]), numbers.tolist()))
    return _renumbered(_homed(pieces, parts, owner, len(known), params.min_points)) if parts else labels


def _homed(pieces: I32, parts: list[tuple[bool, list[int]]], owner: I32, tracks: int, min_points: int) -> I32:
    """Labels in which the pieces of divided clusters are merged with the other points of their tracks.

    parts: whether each divided cluster was wider than any vehicle, and the numbers of its pieces. A piece that is too
    small for a cluster stays with the largest part of a wide one; else it is none, since it would move the track.
    """
    seeds, sizes = kernels.count_seeds(pieces, owner, tracks, int(pieces.max()) + 1), np.bincount(pieces[pieces >= 0])
    goes_to = np.append(np.arange(len(sizes)), -1).astype(np.int32)  # the last entry is for points without a cluster
    for was_wide, numbers in parts:
        largest = max(numbers, key=lambda number: int(sizes[number]))
        for number in numbers:
            track = int(seeds[:, number].argmax())
            home = int(seeds[track].argmax()) if seeds[track, number] > 0 else number
            if home != number and goes_to[home] == home and home not in numbers:
                goes_to[number] = home
            elif sizes[number] < min_points:
                goes_to[number] = largest if was_wide or seeds[track, number] > 0 else -1
    for _ in parts:  # the target may have been merged itself
        goes_to = goes_to[goes_to]
    return goes_to[pieces]


def warm_up(points: F32, labels: I32, tracks: Sequence[LidarTrack]) -> None:
    """Compile the kernels before the first frame."""
    expected = _expect(tracks, np.zeros((len(tracks), 4, 4)), 0.0)
    owner = kernels.find_owners(
        points,
        labels,
        expected.footprints,
        np.zeros((len(tracks), 2)),
        np.zeros((len(tracks), 2)),
        np.zeros(len(tracks)),
        kernels.reach_clusters(points, labels, expected.footprints, 1)[0],
        np.zeros(1, dtype=np.bool_),
    )
    kernels.count_seeds(labels, owner, len(tracks), 1)
    kernels.divide_cluster(points[:2], np.arange(2, dtype=np.int32), np.zeros((2, 2)), 0.0, 1.0, _CELL_M, _MOST_CELLS)


def _expect(tracks: Sequence[LidarTrack], cov: F64, dt_s: float) -> _Expected:
    """cov: (T, 4, 4) covariances of the tracks' filters."""
    velocity = np.array([each.velocity_mps or (0.0, 0.0) for each in tracks])
    rows = [(*each.obstacle.cuboid.center[:2], *each.obstacle.cuboid.size[:2]) for each in tracks]
    footprints = np.array(rows) * (1.0, 1.0, 0.5, 0.5)
    footprints[:, :2] += velocity * dt_s
    yaw = np.array([each.obstacle.cuboid.yaw_rad for each in tracks])
    return _Expected(np.column_stack([footprints, np.cos(yaw), np.sin(yaw)]), velocity, cov[:, 2, 2] + cov[:, 3, 3])


def _nearest(expected: _Expected, params: ClusterParams) -> F64:
    """(T,) ego x below which no return belongs to a track; −∞ unless it drives ahead, seen from behind."""
    if not params.divide_nearer:
        return np.full(len(expected.footprints), -np.inf)
    x, _, length, width, cos, sin = expected.footprints.T
    near = x - length * np.abs(cos) - width * np.abs(sin) - _NEARER_M
    return np.where(expected.velocity[:, 0] > -_CLOSING_MPS, near, -np.inf)


def _parts(
    points: F32, owner: I32, present: I64, widened: bool, rays_rad: float, expected: _Expected, params: ClusterParams
) -> I32 | None:
    """(M,) int32 the part of each point of a cluster, 0 first; None if it stays whole.

    owner: (M,) the track of each point that is a seed, else negative. present: tracks with enough seeds. widened: the
    cluster is wider or nearer than its track, so what is beside or before it may be something else that no track
    follows yet. rays_rad: without a gap of this azimuth, what is no nearer than a track is its flank.
    """
    groups = len(present) + 1  # the last for what is beside the tracks
    apart, wide = np.zeros((groups, groups), dtype=np.bool_), np.full((groups, groups), widened)
    if len(present) > 1:
        apart[:-1, :-1] = _move_apart(expected.velocity[present], expected.variance[present])
        wide[:-1, :-1] = _are_wide(expected.footprints[present])
    if not np.any(apart | wide):
        return None
    number = np.full(len(expected.velocity) + 2, -1, dtype=np.int32)  # the last two are for points that are no seeds
    number[present] = np.arange(len(present), dtype=np.int32)
    number[kernels.OUTSIDE] = len(present) if widened else -1
    gap_m = max(_GAP_M, _GAP_RAD * float(np.hypot(points[:, 0], points[:, 1]).min()))
    # pairs that neither condition separates are treated as without tracks
    together = np.where(wide, gap_m, params.tolerance_m)
    together[apart] = -1.0
    part = kernels.divide_cluster(points, number[owner], together, rays_rad, params.z_weight, _CELL_M, _MOST_CELLS)
    return part if part.max() > 0 else None


def _move_apart(velocity: F64, variance: F64) -> Mask:
    """(T, T) whether the velocities of two tracks differ significantly."""
    differ = np.hypot(*(velocity[:, None] - velocity[None]).transpose(2, 0, 1))
    apart: Mask = differ > np.maximum(_APART_MPS, _APART_SIGMAS * np.sqrt(variance[:, None] + variance[None]))
    return apart


def _are_wide(footprints: F64) -> Mask:
    """(T, T) whether two footprints together are wider than any vehicle: perpendicular to the line of sight to the
    nearer one, or in every direction."""
    x, y, length, width, cos, sin = (column[:, None] for column in footprints.T)
    along, across = length * np.array([1, 1, -1, -1]), width * np.array([1, -1, -1, 1])
    corner_x, corner_y = x + along * cos - across * sin, y + along * sin + across * cos
    turn, away_m = np.arctan2(corner_y, corner_x), np.hypot(corner_x, corner_y).min(axis=1)
    seen_m = _together(turn[:, :, None])[:, :, 0] * np.minimum(away_m[:, None], away_m[None])
    # (T, 4, D) projections of the corners onto D directions
    reach = corner_x[:, :, None] * np.cos(_DIRECTIONS) + corner_y[:, :, None] * np.sin(_DIRECTIONS)
    wide: Mask = (seen_m > WIDEST_M) | (_together(reach).min(axis=2) > WIDEST_M)
    return wide


def _together(corners: F64) -> F64:
    """(T, T, D) extent of two footprints together, from the projections of their corners (T, 4, D)."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    extent: F64 = np.maximum(high[:, None], high[None]) - np.minimum(low[:, None], low[None])
    return extent


def _renumbered(labels: I32) -> I32:
    """The same clusters, numbered in order of their first point."""
    known, first = np.unique(labels, return_index=True)
    clusters = known >= 0
    number = np.full(int(known.max()) + 2, -1, dtype=np.int32)  # the last entry is for points without a cluster
    number[known[clusters][np.argsort(first[clusters])]] = np.arange(clusters.sum(), dtype=np.int32)
    return number[labels]
