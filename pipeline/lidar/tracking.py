"""Obstacles followed over time: recursive Bayes under the Markov assumption (paper, LiDAR Tracking).

Predict, associate one-to-one under gates (position, number of points, density, spread), then add, keep or delete
tracks. Time comes from the sensors' timestamps: nothing here assumes a rate.

The point that is tracked is the middle of a box's rear: the side that faces back along ego x (``looks``). The centre of
a cluster moves by metres when a vehicle's flank comes into view or leaves it, and the nearest point jumps from one
corner to the other; the rear of a vehicle ahead is stable in both x and y. For oncoming traffic it is the front.

The paper computes velocity "from the trajectory": ``trajectory`` fits a line to the last positions by their stamps.
``kalman`` is a constant-velocity filter. Velocities are relative to ego, and change with own motion where it is known.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numba
import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.common import kalman
from pipeline.common.geometry import Cuboid
from pipeline.lidar.track_history import first_sightings, recorded, rigid_sideways, side_that_stays, slopes
from pipeline.params import LidarTrackingParams
from pipeline.types import F64, I64, LidarTrack, Obstacle, Point3

NEVER = 1e6
"""Cost of a pair that a gate forbids."""
MIN_GATE_POINTS = 10
"""Below this many points, counts and densities are noise: one ring more or less doubles them."""
_SIDES_FRAMES = 10
"""Sightings over which the sides of a footprint are compared: one second at 10 Hz."""
_JUMP_M = 1.0
"""If a cluster is farther than this from its predicted position, it is a different part of the object: this is several
times its noise, and ten times the effect of braking at 1 g within a tenth of a second. Its velocity is wrong for a
while."""
THINNEST_M = 0.5
"""Minimum thickness of a footprint for comparing densities. A rear alone is as thin as the LiDAR's noise; with some
flank the same car has twenty times the area."""


class Looks(NamedTuple):
    """Features of obstacles used for association."""

    place: F64
    """(M, 2) reference points, ego x, y."""
    shape: F64
    """(M, 5) number of points, density, spread along x, y and z, as used by the gates."""
    sides: F64
    """(M, 2) minimum and maximum ego y of each footprint."""


_NO_FILTERS = kalman.CvState(np.zeros((0, 4)), np.zeros((0, 4, 4)))


@dataclass(frozen=True)
class LidarTrackerState:
    """State from one frame to the next; arrays have one row per track, in the order of ``tracks``."""

    tracks: tuple[LidarTrack, ...] = ()
    """Tracks as passed to fusion."""
    filters: kalman.CvState = _NO_FILTERS
    """mean (T, 4), cov (T, 4, 4)."""
    shape: F64 = field(default_factory=lambda: np.zeros((0, 5)))
    """(T, 5) shape at the last sighting, as in ``Looks``."""
    history: F64 = field(default_factory=lambda: np.zeros((0, 1, 5)))
    """(T, H, 5) ``t_s x y low high``: reference points and sides of the last sightings, newest last, NaN before the
    first."""
    next_id: int = 1
    """Number of the next new track; numbers are never reused."""
    clock_s: float = 0.0
    """Seconds since the first frame; the time base of ``history``."""


def track(
    state: LidarTrackerState,
    obstacles: tuple[Obstacle, ...] | None,
    dt_s: float | None,
    params: LidarTrackingParams,
    change: kalman.Transition | None = None,
) -> tuple[LidarTrackerState, tuple[LidarTrack, ...]]:
    """One tick: the next state, and all live tracks by ascending id.

    obstacles: None if the LiDAR delivered nothing; then every track is predicted without an update. dt_s: seconds ≥ 0
    since the previous tick; None at the first tick, which drops earlier tracks. change: of relative motion since then
    (``pipeline.ego_motion.frame_change``); None if own motion is unknown.
    """
    if dt_s is None:
        state, dt_s = LidarTrackerState(next_id=state.next_id, clock_s=state.clock_s), 0.0
    # Predict every track to now and assign the nearest obstacle that its gates permit, one-to-one
    clock_s = state.clock_s + dt_s
    sweep, has_sweep = obstacles or (), obstacles is not None
    seen = looks(sweep)
    filters = kalman.predict(state.filters, dt_s, params.accel_sigma_mps2, change)
    expected = filters.mean
    partner = associate(state, filters, seen, dt_s, params)
    jumped = _jumped(filters, seen, partner)
    if params.cut_off_is_no_motion:
        filters = _cut_off(filters, state.history, clock_s, seen, partner)
    filters = _correct(filters, seen.place, partner, params)
    where = np.concatenate([seen.place, seen.sides], axis=1)
    history = recorded(state.history, partner, where, clock_s, max(params.trajectory_frames, _SIDES_FRAMES))
    velocity, is_filtered = filters.mean[:, 2:], params.filter == "kalman"
    if not is_filtered:
        velocity = slopes(history[:, -params.trajectory_frames :, :3])
    sideways: list[float | None] = [None] * len(history)
    if params.rigid_sideways:
        sideways = rigid_sideways(history[:, -_SIDES_FRAMES:]).tolist()

    # Update matched tracks; carry or drop the others
    tracks, rows, sigmas = [], [], np.sqrt(filters.cov[:, 2, 2]).tolist()
    for i, (last, j, speed) in enumerate(zip(state.tracks, partner.tolist(), velocity.tolist(), strict=True)):
        if j >= 0:
            known = (speed[0], speed[1]) if speed[0] == speed[0] else None
            steady = 0 if jumped[i] and last.hits > 1 else last.steady + 1
            hits = last.hits + 1
            tracks.append(LidarTrack(last.id, sweep[j], known, hits, 0, False, 0.0, sideways[i], steady, sigmas[i]))
        elif _lives_on(last, last.unseen_s + dt_s, has_sweep, params):
            carried = _carried(last, dt_s, expected[i] - state.filters.mean[i] if is_filtered else None)
            tracks.append(carried if last.hits == 1 else carried._replace(speed_sigma_mps=sigmas[i]))
        else:
            continue
        rows.append(i)

    # Start a new track for every unmatched obstacle
    matched = partner >= 0
    is_fresh = np.ones(len(sweep), dtype=np.bool_)
    is_fresh[partner[matched]] = False
    fresh = np.flatnonzero(is_fresh)
    tracks += [LidarTrack(state.next_id + k, sweep[j], None, 1, 0, False) for k, j in enumerate(fresh.tolist())]
    shape = state.shape.copy()
    shape[matched] = seen.shape[partner[matched]]
    begun = kalman.start(seen.place[fresh], _noise(params), params.start_speed_mps)
    next_state = LidarTrackerState(
        tracks=tuple(tracks),
        filters=kalman.CvState(
            np.concatenate([filters.mean[rows], begun.mean]), np.concatenate([filters.cov[rows], begun.cov])
        ),
        shape=np.concatenate([shape[rows], seen.shape[fresh]]),
        history=np.concatenate([history[rows], first_sightings(where[fresh], clock_s, history.shape[1])]),
        next_id=state.next_id + len(fresh),
        clock_s=clock_s,
    )
    return next_state, next_state.tracks


def looks(obstacles: tuple[Obstacle, ...]) -> Looks:
    """Position and shape of each obstacle. The reference point is the middle of the footprint's rear: the end with the
    smaller x of the axis that is closer to ego x."""
    rows = [(*o.cuboid.center, *o.cuboid.size, o.cuboid.yaw_rad, o.points, o.density, *o.spread) for o in obstacles]
    return Looks(*_looks(np.array(rows, dtype=np.float64).reshape(-1, 12)))


@numba.njit(cache=True, nogil=True)
def _looks(rows):  # type: ignore[no-untyped-def]  # pragma: no cover
    """place (M, 2), shape (M, 5) and sides (M, 2) of (M, 12) center x y z, length, width, height, yaw,
    points, density, spread."""
    place, shape, sides = np.empty((len(rows), 2)), np.empty((len(rows), 5)), np.empty((len(rows), 2))
    for i in range(len(rows)):
        length, width, yaw, points = rows[i, 3], rows[i, 4], rows[i, 6], rows[i, 7]
        across = abs(np.cos(yaw)) < np.sqrt(0.5)
        heading = yaw + np.pi / 2 if across else yaw
        reach = (width if across else length) / 2 * (1.0 if np.cos(heading) >= 0.0 else -1.0)
        place[i, 0], place[i, 1] = rows[i, 0] - reach * np.cos(heading), rows[i, 1] - reach * np.sin(heading)
        for k in range(5):
            shape[i, k] = rows[i, 7 + k]
        shape[i, 0] = max(points, MIN_GATE_POINTS)
        spread_over = length * width / (max(length, THINNEST_M) * max(width, THINNEST_M))
        shape[i, 1] *= spread_over * max(1.0, MIN_GATE_POINTS / max(points, 1.0))
        half = (length * abs(np.sin(yaw)) + width * abs(np.cos(yaw))) / 2
        sides[i, 0], sides[i, 1] = rows[i, 1] - half, rows[i, 1] + half
    return place, shape, sides


def associate(
    state: LidarTrackerState, filters: kalman.CvState, seen: Looks, dt_s: float, params: LidarTrackingParams
) -> I64:
    """(T,) the obstacle of each track, −1 for none: one-to-one, gated pairs only, with the smallest total distance,
    where an unmatched track costs as much as a pair at its gate. (Maximising the number of pairs would swap the tracks
    of two cars if the obstacle of one has changed too much.) The filters are already predicted to now."""
    partner = np.full(len(state.tracks), -1)
    if not state.tracks or not len(seen.place):
        return partner
    # a copy, since numba treats a non-contiguous slice as a separate type
    expected = filters.mean[:, :2].copy() if params.filter == "kalman" else _extrapolated(state, dt_s)
    new = np.array([t.hits < 2 for t in state.tracks])
    gate = params.gate_m + new * params.start_speed_mps * dt_s
    cost = _gated(
        expected,
        seen.place,
        gate,
        state.shape,
        seen.shape,
        params.max_count_ratio,
        params.max_density_ratio,
        params.max_spread_change_m,
    )
    rows, columns = linear_sum_assignment(np.minimum(cost, gate[:, None]))
    allowed = cost[rows, columns] < NEVER
    partner[rows[allowed]] = columns[allowed]
    return partner


@numba.njit(cache=True, nogil=True)
def _gated(
    expected: F64,
    places: F64,
    gate: F64,
    before: F64,
    now: F64,
    max_count_ratio: float,
    max_density_ratio: float,
    max_spread_change_m: float,
) -> F64:
    """(n, m) distance of each obstacle from each expected position; ``NEVER`` if a gate forbids the pair. before, now:
    (n, 5) and (m, 5) as in ``Looks.shape``."""
    cost = np.full((len(expected), len(places)), NEVER)
    for i in range(len(expected)):
        for j in range(len(places)):
            dx, dy = expected[i, 0] - places[j, 0], expected[i, 1] - places[j, 1]
            if abs(dx) > gate[i] or abs(dy) > gate[i]:
                continue
            distance = np.hypot(dx, dy)
            like = max(before[i, 0], now[j, 0]) <= max_count_ratio * min(before[i, 0], now[j, 0])
            like &= max(before[i, 1], now[j, 1]) <= max_density_ratio * min(before[i, 1], now[j, 1])
            for axis in range(2, 5):
                like &= abs(before[i, axis] - now[j, axis]) <= max_spread_change_m
            if like and distance <= gate[i]:
                cost[i, j] = distance
    return cost


def _extrapolated(state: LidarTrackerState, dt_s: float) -> F64:
    """(T, 2) positions extrapolated from the trajectories to now."""
    since_s = np.array([[t.unseen_s + dt_s] for t in state.tracks])
    velocity = np.array([t.velocity_mps or (0.0, 0.0) for t in state.tracks])
    return np.asarray(state.history[:, -1, 1:3] + velocity * since_s)


def _jumped(filters: kalman.CvState, seen: Looks, partner: I64) -> list[bool]:
    """Whether each track's obstacle is far from its predicted position. filters: predicted to now."""
    if not len(seen.place):
        return [False] * len(partner)
    away = seen.place[partner] - filters.mean[:, :2]
    return [far and j >= 0 for far, j in zip((np.hypot(*away.T) > _JUMP_M).tolist(), partner.tolist(), strict=True)]


def _cut_off(filters: kalman.CvState, history: F64, now_s: float, seen: Looks, partner: I64) -> kalman.CvState:
    """The predicted filters. Where a part of a footprint was cut off, they expect the reference point of what is left,
    so that its measurement tells the motion of the side that stays."""
    rows = np.flatnonzero(partner >= 0)
    new = partner[rows]
    off_m = side_that_stays(history[rows], filters.mean[rows, 3], now_s, seen.sides[new])
    is_cut = ~np.isnan(off_m)
    if not is_cut.any():
        return filters
    mean = filters.mean.copy()
    mean[rows[is_cut], 1] = seen.place[new[is_cut], 1] - off_m[is_cut]
    return kalman.CvState(mean, filters.cov)


def _correct(filters: kalman.CvState, place: F64, partner: I64, params: LidarTrackingParams) -> kalman.CvState:
    """The filters updated by their measurements; unmatched ones stay as predicted."""
    rows = np.flatnonzero(partner >= 0)
    if not len(rows):
        return filters
    after = kalman.update(kalman.CvState(filters.mean[rows], filters.cov[rows]), place[partner[rows]], _noise(params))
    mean, cov = filters.mean.copy(), filters.cov.copy()
    mean[rows], cov[rows] = after.mean, after.cov
    return kalman.CvState(mean, cov)


def _noise(params: LidarTrackingParams) -> F64:
    return np.eye(2) * params.position_sigma_m**2


def _lives_on(last: LidarTrack, unseen_s: float, has_sweep: bool, params: LidarTrackingParams) -> bool:
    """Whether an unseen track is carried. A track seen only once or twice is dropped at once: its velocity is the
    difference of two noisy positions and would move a ghost across the road."""
    too_young = has_sweep and last.hits < params.carry_hits
    return not too_young and unseen_s <= params.max_missed_s + 1e-9


def _carried(last: LidarTrack, dt_s: float, change: F64 | None) -> LidarTrack:
    """The obstacle of an unseen track, moved with its filter. It belongs to no cluster of this sweep (−1). change: (4,)
    of the filter's mean; None without a filter, where the last velocity goes on."""
    velocity = last.velocity_mps
    dx, dy = (each * dt_s for each in velocity or (0.0, 0.0))
    if change is not None and velocity is not None:
        dx, dy, dvx, dvy = change.tolist()
        velocity = velocity[0] + dvx, velocity[1] + dvy
    _, cuboid, closest, points, density, spread = last.obstacle
    there = Cuboid(_moved(cuboid.center, dx, dy), cuboid.size, cuboid.yaw_rad)
    moved = Obstacle(-1, there, _moved(closest, dx, dy), points, density, spread)
    unseen_s = last.unseen_s + dt_s
    return LidarTrack(last.id, moved, velocity, last.hits, last.missed + 1, True, unseen_s, last.rigid_mps, last.steady)


def _moved(point: Point3, dx: float, dy: float) -> Point3:
    return point[0] + dx, point[1] + dy, point[2]
