"""Obstacles followed over time: recursive Bayes under the Markov assumption (paper, LiDAR Tracking).

Predict, associate one-to-one under gates (place, number of points, density, spread), then add, keep or delete tracks.
Time is the sensors' own: nothing here assumes a rate.

What is followed is the middle of a box's rear: the side that faces back along ego x (``reference_points``). The centre
of a cluster moves by metres when a vehicle's flank goes in or out of view, the nearest point jumps from one corner to
the other; the rear of a vehicle ahead stays in both x and y. For oncoming traffic the same side is its front.

The paper computes velocity "from the trajectory": ``trajectory`` fits a line to the last positions by their stamps.
``kalman`` is a constant-velocity filter. Velocities are relative to ego.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline import kalman
from pipeline.params import LidarTrackingParams
from pipeline.records import evolve
from pipeline.types import F64, LidarTrack, Obstacle, Point2

NEVER = 1e6
"""Cost of a pair that a gate forbids: more than all allowed ones together."""
MIN_GATE_POINTS = 10
"""Counts and densities below this many points are noise: one ring more or less doubles them."""


_NO_FILTERS = kalman.CvState(np.zeros((0, 4)), np.zeros((0, 4, 4)))


@dataclass(frozen=True)
class Tracked:
    """One track and its past. ``history``: (t_s, x, y) of the last sightings' reference points, oldest first."""

    track: LidarTrack
    history: tuple[tuple[float, float, float], ...]
    missed_s: float = 0.0


@dataclass(frozen=True)
class LidarTrackerState:
    """All that one frame leaves to the next. ``filters``: one state a track, in the order of ``tracks``, mean (T, 4),
    cov (T, 4, 4). ``clock_s`` runs from the first frame."""

    tracks: tuple[Tracked, ...] = ()
    filters: kalman.CvState = _NO_FILTERS
    next_id: int = 1
    clock_s: float = 0.0


def track(
    state: LidarTrackerState,
    obstacles: tuple[Obstacle, ...] | None,
    dt_s: float | None,
    params: LidarTrackingParams,
) -> tuple[LidarTrackerState, tuple[LidarTrack, ...]]:
    """One tick: the next state, and every living track by ascending id.

    obstacles: null when the LiDAR delivered nothing, in which case every track is carried on by its prediction. dt_s:
    seconds ≥ 0 since the tick before; null at the first, and then no track of an earlier time lives on.
    """
    if dt_s is None:
        state, dt_s = LidarTrackerState(next_id=state.next_id, clock_s=state.clock_s), 0.0
    clock_s = state.clock_s + dt_s
    filters = kalman.predict(state.filters, dt_s, params.accel_sigma_mps2)
    places = reference_points(obstacles or ())
    partner = associate(state.tracks, filters, obstacles or (), places, dt_s, params)
    filters = _correct(filters, places, partner, params)

    tracks, rows = [], []
    for i, tracked in enumerate(state.tracks):
        seen = partner.get(i)
        if obstacles is not None and seen is not None:
            after = _sight(tracked, filters.mean[i], obstacles[seen], places[seen], clock_s, params)
        else:
            after = _carry(tracked, dt_s)
            if _ended(after, obstacles is not None, params):
                continue
        tracks.append(after)
        rows.append(i)
    taken = set(partner.values())
    fresh = [j for j in range(len(places)) if j not in taken]
    tracks += [_begin(state.next_id + k, (obstacles or ())[j], places[j], clock_s) for k, j in enumerate(fresh)]
    begun = kalman.start(places[fresh], _noise(params), params.start_speed_mps)
    filters = kalman.CvState(
        np.concatenate([filters.mean[rows], begun.mean]), np.concatenate([filters.cov[rows], begun.cov])
    )
    next_state = LidarTrackerState(tuple(tracks), filters, state.next_id + len(fresh), clock_s)
    return next_state, tuple(t.track for t in tracks)


def reference_points(obstacles: tuple[Obstacle, ...]) -> F64:
    """(M, 2) the middle of each footprint's rear: of its two axes the one closer to ego x, at the end of smaller x."""
    rows = [(*o.cuboid.center[:2], *o.cuboid.size[:2], o.cuboid.yaw_rad) for o in obstacles]
    x, y, length, width, yaw = np.array(rows, dtype=np.float64).reshape(-1, 5).T
    across = np.abs(np.cos(yaw)) < np.sqrt(0.5)
    heading = np.where(across, yaw + np.pi / 2, yaw)
    reach = np.where(across, width, length) / 2 * np.where(np.cos(heading) >= 0.0, 1.0, -1.0)
    return np.column_stack([x - reach * np.cos(heading), y - reach * np.sin(heading)])


def associate(
    tracks: tuple[Tracked, ...],
    filters: kalman.CvState,
    obstacles: tuple[Obstacle, ...],
    places: F64,
    dt_s: float,
    params: LidarTrackingParams,
) -> dict[int, int]:
    """Index of a track → index of its obstacle, one-to-one, of least total distance, gated pairs only. The filters
    stand at the present time already."""
    if not tracks or not obstacles:
        return {}
    kalman_filter = params.filter == "kalman"
    expected = filters.mean[:, :2] if kalman_filter else np.array([_extrapolate(t, dt_s) for t in tracks])
    new = np.array([t.track.hits < 2 for t in tracks])
    gate = params.gate_m + new * params.start_speed_mps * dt_s
    before, now = _shape([t.track.obstacle for t in tracks]), _shape(list(obstacles))
    cost = _gated(
        expected,
        places,
        gate,
        before,
        now,
        params.max_count_ratio,
        params.max_density_ratio,
        params.max_spread_change_m,
    )
    rows, columns = linear_sum_assignment(cost)
    return {int(i): int(j) for i, j in zip(rows, columns, strict=True) if cost[i, j] < NEVER}


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
    """(n, m) distance of each obstacle from each expected place; ``NEVER`` where a gate keeps the two apart. before,
    now: (n, 5) and (m, 5) as ``_shape`` gives them."""
    cost = np.full((len(expected), len(places)), NEVER)
    for i in range(len(expected)):
        for j in range(len(places)):
            distance = np.hypot(expected[i, 0] - places[j, 0], expected[i, 1] - places[j, 1])
            like = max(before[i, 0], now[j, 0]) <= max_count_ratio * min(before[i, 0], now[j, 0])
            like &= max(before[i, 1], now[j, 1]) <= max_density_ratio * min(before[i, 1], now[j, 1])
            for axis in range(2, 5):
                like &= abs(before[i, axis] - now[j, axis]) <= max_spread_change_m
            if like and distance <= gate[i]:
                cost[i, j] = distance
    return cost


def _shape(obstacles: list[Obstacle]) -> F64:
    """(M, 5) points, density, spread x, y, z, as the gates compare them."""
    rows = [
        (max(o.points, MIN_GATE_POINTS), o.density * max(1.0, MIN_GATE_POINTS / o.points), *o.spread) for o in obstacles
    ]
    return np.array(rows, dtype=np.float64)


def _extrapolate(tracked: Tracked, dt_s: float) -> Point2:
    """Where the trajectory leads to now."""
    vx, vy = tracked.track.velocity_mps or (0.0, 0.0)
    _, x, y = tracked.history[-1]
    since_s = tracked.missed_s + dt_s
    return (x + vx * since_s, y + vy * since_s)


def _correct(
    filters: kalman.CvState, places: F64, partner: dict[int, int], params: LidarTrackingParams
) -> kalman.CvState:
    """The filters after their measurements; as predicted where there is none."""
    if not partner:
        return filters
    rows = sorted(partner)
    z = places[[partner[i] for i in rows]]
    after = kalman.update(kalman.CvState(filters.mean[rows], filters.cov[rows]), z, _noise(params))
    mean, cov = filters.mean.copy(), filters.cov.copy()
    mean[rows], cov[rows] = after.mean, after.cov
    return kalman.CvState(mean, cov)


def _noise(params: LidarTrackingParams) -> F64:
    return np.eye(2) * params.position_sigma_m**2


def _sight(
    tracked: Tracked, mean: F64, obstacle: Obstacle, place: F64, clock_s: float, params: LidarTrackingParams
) -> Tracked:
    """Seen again."""
    history = (*tracked.history, (clock_s, float(place[0]), float(place[1])))[-params.trajectory_frames :]
    velocity = (float(mean[2]), float(mean[3])) if params.filter == "kalman" else slope(history)
    last = tracked.track
    seen = evolve(
        last, obstacle=obstacle, velocity_mps=velocity, hits=last.hits + 1, missed=0, carried=False, unseen_s=0.0
    )
    return evolve(tracked, track=seen, history=history, missed_s=0.0)


def slope(history: tuple[tuple[float, float, float], ...]) -> Point2 | None:
    """Velocity in m/s of the least-squares line through (t_s, x, y); null when all are of one time."""
    t, x, y = np.array(history).T
    t = t - t.mean()
    spread = float(t @ t)
    return (float(t @ x) / spread, float(t @ y) / spread) if spread > 0.0 else None


def _carry(tracked: Tracked, dt_s: float) -> Tracked:
    """Not seen: the obstacle as it was, moved on by its velocity. It belongs to no cluster of this sweep (−1)."""
    last, seen = tracked.track, tracked.track.obstacle
    vx, vy = last.velocity_mps or (0.0, 0.0)
    (cx, cy, cz), (px, py, pz) = seen.cuboid.center, seen.closest_point
    cuboid = evolve(seen.cuboid, center=(cx + vx * dt_s, cy + vy * dt_s, cz))
    moved = evolve(seen, cluster=-1, cuboid=cuboid, closest_point=(px + vx * dt_s, py + vy * dt_s, pz))
    unseen_s = tracked.missed_s + dt_s
    carried = evolve(last, obstacle=moved, missed=last.missed + 1, carried=True, unseen_s=unseen_s)
    return evolve(tracked, track=carried, missed_s=unseen_s)


def _ended(tracked: Tracked, sweep_lacks_it: bool, params: LidarTrackingParams) -> bool:
    """Whether a carried track is given up. One seen only once or twice does not outlive a sweep that lacks it: its
    velocity is the difference of two noisy places, and would send a ghost across the road."""
    too_young = sweep_lacks_it and tracked.track.hits < params.carry_hits
    return too_young or tracked.missed_s > params.max_missed_s + 1e-9


def _begin(track_id: int, obstacle: Obstacle, place: F64, clock_s: float) -> Tracked:
    """A track for an obstacle that continues none."""
    return Tracked(LidarTrack(track_id, obstacle, None, 1, 0, False), ((clock_s, float(place[0]), float(place[1])),))
