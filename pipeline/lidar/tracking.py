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

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from pipeline import kalman
from pipeline.params import LidarTrackingParams
from pipeline.types import F64, LidarTrack, Obstacle, Point2

NEVER = 1e6
"""Cost of a pair that a gate forbids: more than all allowed ones together."""
MIN_GATE_POINTS = 10
"""Counts and densities below this many points are noise: one ring more or less doubles them."""


@dataclass(frozen=True)
class Tracked:
    """One track and what its filters remember. ``history``: (t_s, x, y) of the last sightings, oldest first."""

    track: LidarTrack
    filter: kalman.CvState
    history: tuple[tuple[float, float, float], ...]
    missed_s: float = 0.0


@dataclass(frozen=True)
class LidarTrackerState:
    """All that one frame leaves to the next. ``clock_s`` runs from the first frame."""

    tracks: tuple[Tracked, ...] = ()
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
    living = () if dt_s is None else _predict(state.tracks, dt_s, params)
    clock_s = state.clock_s + (dt_s or 0.0)
    if obstacles is None:
        kept = [t for t in (_carry(t, dt_s or 0.0) for t in living) if t.missed_s <= params.max_missed_s]
        return LidarTrackerState(tuple(kept), state.next_id, clock_s), tuple(t.track for t in kept)

    places = reference_points(obstacles)
    partner = associate(living, obstacles, places, dt_s or 0.0, params)
    measured = _update(living, places, partner, params)
    kept = []
    for index, (tracked, filtered) in enumerate(zip(living, measured, strict=True)):
        seen = partner.get(index)
        if seen is not None:
            kept.append(_sight(tracked, filtered, obstacles[seen], places[seen], clock_s, params))
        else:
            carried = _carry(tracked, dt_s or 0.0)
            if carried.missed_s <= params.max_missed_s and carried.track.hits >= params.carry_hits:
                kept.append(carried)
    taken = set(partner.values())
    fresh = [j for j in range(len(obstacles)) if j not in taken]
    kept += _begin([obstacles[j] for j in fresh], places[fresh], state.next_id, clock_s, params)
    return LidarTrackerState(tuple(kept), state.next_id + len(fresh), clock_s), tuple(t.track for t in kept)


def reference_points(obstacles: tuple[Obstacle, ...]) -> F64:
    """(M, 2) the middle of each footprint's rear: of its two axes the one closer to ego x, at the end of smaller x."""
    rows = [(*o.cuboid.center[:2], *o.cuboid.size[:2], o.cuboid.yaw_rad) for o in obstacles]
    x, y, length, width, yaw = np.array(rows, dtype=np.float64).reshape(-1, 5).T
    across = np.abs(np.cos(yaw)) < np.sqrt(0.5)
    heading = np.where(across, yaw + np.pi / 2, yaw)
    reach = np.where(across, width, length) / 2 * np.where(np.cos(heading) >= 0.0, 1.0, -1.0)
    return np.column_stack([x - reach * np.cos(heading), y - reach * np.sin(heading)])


def associate(
    tracks: tuple[Tracked, ...], obstacles: tuple[Obstacle, ...], places: F64, dt_s: float, params: LidarTrackingParams
) -> dict[int, int]:
    """Index of a predicted track → index of its obstacle, one-to-one, of least total distance; gated pairs only."""
    if not tracks or not obstacles:
        return {}
    expected = np.array([_place(t, dt_s, params) for t in tracks])
    distance = np.linalg.norm(expected[:, None] - places, axis=2)
    new = np.array([t.track.hits < 2 for t in tracks])
    gate = params.gate_m + new * params.start_speed_mps * dt_s
    before, now = _shape([t.track.obstacle for t in tracks]), _shape(list(obstacles))
    allowed = (
        (distance <= gate[:, None])
        & (_ratio(before[:, 0], now[:, 0]) <= params.max_count_ratio)
        & (_ratio(before[:, 1], now[:, 1]) <= params.max_density_ratio)
        & np.all(np.abs(before[:, None, 2:] - now[:, 2:]) <= params.max_spread_change_m, axis=2)
    )
    rows, columns = linear_sum_assignment(np.where(allowed, distance, NEVER))
    return {int(i): int(j) for i, j in zip(rows, columns, strict=True) if allowed[i, j]}


def _shape(obstacles: list[Obstacle]) -> F64:
    """(M, 5) points, density, spread x, y, z, as the gates compare them."""
    rows = [
        (max(o.points, MIN_GATE_POINTS), o.density * max(1.0, MIN_GATE_POINTS / o.points), *o.spread) for o in obstacles
    ]
    return np.array(rows, dtype=np.float64)


def _ratio(a: F64, b: F64) -> F64:
    """(n, m) the larger over the smaller of each pair of positive values."""
    return np.maximum(a[:, None], b) / np.minimum(a[:, None], b)


def _place(tracked: Tracked, dt_s: float, params: LidarTrackingParams) -> npt.ArrayLike:
    """Where the reference point is expected now. The state's filter has been predicted to now already."""
    if params.filter == "kalman":
        return tracked.filter.mean[:2]
    vx, vy = tracked.track.velocity_mps or (0.0, 0.0)
    _, x, y = tracked.history[-1]
    since_s = tracked.missed_s + dt_s
    return (x + vx * since_s, y + vy * since_s)


def _predict(tracks: tuple[Tracked, ...], dt_s: float, params: LidarTrackingParams) -> tuple[Tracked, ...]:
    """Every filter at the present time."""
    if not tracks:
        return ()
    later = kalman.predict(_stack(tracks), dt_s, params.accel_sigma_mps2)
    return tuple(replace(t, filter=kalman.CvState(m, c)) for t, m, c in zip(tracks, later.mean, later.cov, strict=True))


def _update(
    tracks: tuple[Tracked, ...], places: F64, partner: dict[int, int], params: LidarTrackingParams
) -> list[kalman.CvState]:
    """The filter of each track after its measurement; as predicted where it has none."""
    filters = [t.filter for t in tracks]
    if partner:
        matched = sorted(partner)
        z = places[[partner[i] for i in matched]]
        after = kalman.update(_stack([tracks[i] for i in matched]), z, _noise(params))
        for i, mean, cov in zip(matched, after.mean, after.cov, strict=True):
            filters[i] = kalman.CvState(mean, cov)
    return filters


def _stack(tracks: tuple[Tracked, ...] | list[Tracked]) -> kalman.CvState:
    return kalman.CvState(np.array([t.filter.mean for t in tracks]), np.array([t.filter.cov for t in tracks]))


def _noise(params: LidarTrackingParams) -> F64:
    return np.eye(2) * params.position_sigma_m**2


def _sight(
    tracked: Tracked,
    filtered: kalman.CvState,
    obstacle: Obstacle,
    place: F64,
    clock_s: float,
    params: LidarTrackingParams,
) -> Tracked:
    """Seen again."""
    history = (*tracked.history, (clock_s, float(place[0]), float(place[1])))[-params.trajectory_frames :]
    if params.filter == "kalman":
        velocity: Point2 | None = (float(filtered.mean[2]), float(filtered.mean[3]))
    else:
        velocity = slope(history)
    last = tracked.track
    return Tracked(LidarTrack(last.id, obstacle, velocity, last.hits + 1, 0, False), filtered, history)


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
    moved = replace(
        seen,
        cluster=-1,
        cuboid=replace(seen.cuboid, center=(cx + vx * dt_s, cy + vy * dt_s, cz)),
        closest_point=(px + vx * dt_s, py + vy * dt_s, pz),
    )
    track = replace(last, obstacle=moved, missed=last.missed + 1, carried=True)
    return replace(tracked, track=track, missed_s=tracked.missed_s + dt_s)


def _begin(
    obstacles: list[Obstacle], places: F64, first_id: int, clock_s: float, params: LidarTrackingParams
) -> list[Tracked]:
    """A track for each obstacle that continues none."""
    if not obstacles:
        return []
    filters = kalman.start(places, _noise(params), params.start_speed_mps)
    return [
        Tracked(
            LidarTrack(first_id + k, obstacle, None, 1, 0, False),
            kalman.CvState(filters.mean[k], filters.cov[k]),
            ((clock_s, float(places[k, 0]), float(places[k, 1])),),
        )
        for k, obstacle in enumerate(obstacles)
    ]
