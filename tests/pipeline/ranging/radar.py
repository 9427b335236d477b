"""A radar, as a contributor would add it: its declaration, its tracker and its simulation. In the product, the tracker
would be ``pipeline/ranging/radar.py``, the simulation ``pipeline/simulation/sensors/radar.py``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.common import kalman
from pipeline.params import Params
from pipeline.simulation.world.world_state import ActorState, World
from pipeline.types import F32, F64, Moment, Point2, RangedTrack, RangeScan
from pipeline.types.sensors import SensorKind

RADAR = SensorKind(
    letter="R",
    name="radar",
    title="radar",
    is_ranging=True,
    tracker="tests.pipeline.ranging.radar:follow",
    simulator="tests.pipeline.ranging.radar:simulated_scan",
    sighting_odds=1.0,
)

RANGE_SIGMA_M, BEARING_SIGMA_RAD, RATE_SIGMA_MPS = 0.15, math.radians(0.3), 0.1
REACH_M, HALF_VIEW_RAD = 160.0, math.radians(45.0)
_ACCEL_SIGMA_MPS2, _SPEED_SIGMA_MPS = 2.0, 10.0
_SAME = 13.82
"""99.9 % point of χ² with two degrees of freedom."""
_CARRIED_S = 0.5


class RadarTrack(NamedTuple):
    """A track with its filter."""

    id: int
    """Never given twice."""
    filter: kalman.CvState
    """Position and velocity relative to ego."""
    hits: int
    """Sightings so far."""
    unseen_s: float
    """Time since the last one."""


@dataclass(frozen=True)
class RadarState:
    """The tracks of one frame."""

    followed: tuple[RadarTrack, ...] = ()
    """In order of their ids."""
    next_id: int = 1
    """Of the next new track."""


def follow(
    state: RadarState | None, scan: RangeScan | None, now: Moment, params: Params
) -> tuple[RadarState, tuple[RangedTrack, ...]]:
    """Nearest detection to each track; what belongs to no track begins one, with the speed of its range rate."""
    state, dt_s = state or RadarState(), now.dt_s or 0.0
    left = list(range(len(scan.points))) if scan is not None else []
    followed = []
    for track in state.followed:
        ahead = kalman.predict(track.filter, dt_s, _ACCEL_SIGMA_MPS2)
        found = min(left, key=lambda each: _apart(ahead, scan.points[each]), default=None) if scan is not None else None
        if scan is not None and found is not None and _apart(ahead, scan.points[found]) <= _SAME:
            left.remove(found)
            seen = kalman.update(ahead, scan.points[found, :2], _noise(scan.points[found]))
            followed.append(RadarTrack(track.id, seen, track.hits + 1, 0.0))
        elif track.unseen_s + dt_s <= _CARRIED_S:
            followed.append(track._replace(filter=ahead, unseen_s=track.unseen_s + dt_s))
    for place, detection in enumerate(left):
        assert scan is not None
        begun = _begun(scan.points[detection], float(scan.values["range_rate_mps"][detection]))
        followed.append(RadarTrack(state.next_id + place, begun, 1, 0.0))
    return RadarState(tuple(followed), state.next_id + len(left)), tuple(map(_track, followed))


def _begun(point: F32, rate_mps: float) -> kalman.CvState:
    begun = kalman.start(point[:2], _noise(point), _SPEED_SIGMA_MPS)
    begun.mean[2:] = rate_mps * np.asarray(point[:2]) / np.hypot(*point[:2])
    return begun


def _noise(point: F32) -> F64:
    """(2, 2) covariance of a detection in ego x, y: range and bearing are measured."""
    x, y = float(point[0]), float(point[1])
    range_m = math.hypot(x, y)
    turn = np.array([[x, -y], [y, x]]) / range_m
    return turn @ np.diag([RANGE_SIGMA_M**2, (range_m * BEARING_SIGMA_RAD) ** 2]) @ turn.T


def _apart(ahead: kalman.CvState, point: F32) -> float:
    return kalman.mahalanobis2(ahead, point[:2], _noise(point))


def _track(each: RadarTrack) -> RangedTrack:
    x, y, vx, vy = each.filter.mean.tolist()
    along = np.array([x, y]) / math.hypot(x, y)
    across = np.array([-along[1], along[0]])
    cov = each.filter.cov[:2, :2]
    sigma_m: Point2 = (math.sqrt(along @ cov @ along), math.sqrt(across @ cov @ across))
    return RangedTrack(each.id, (x, y), sigma_m, (vx, vy), each.hits, each.unseen_s > 0.0, each.hits)


def simulated_scan(now: World, seed: int, index: int, t_ns: int) -> RangeScan:
    """One detection of every vehicle in view, at the point of its footprint that is nearest to the sensor."""
    random = np.random.default_rng([seed, 31, index])
    points, rates = [], []
    for state in now.actors:
        x, y = _nearest(state)
        range_m, bearing = math.hypot(x, y), math.atan2(y, x)
        if range_m > REACH_M or abs(bearing) > HALF_VIEW_RAD:
            continue
        yaw = state.cuboid.yaw_rad
        vx, vy = state.speed_mps * math.cos(yaw) - now.speed_mps, state.speed_mps * math.sin(yaw)
        noise = random.standard_normal(3)
        r, b = range_m + RANGE_SIGMA_M * noise[0], bearing + BEARING_SIGMA_RAD * noise[1]
        points.append((r * math.cos(b), r * math.sin(b), 0.0))
        rates.append((x * vx + y * vy) / range_m + RATE_SIGMA_MPS * noise[2])
    found = np.array(points, np.float32).reshape(-1, 3)
    return RangeScan(t_ns, found, {"range_rate_mps": np.array(rates, np.float32)})


def _nearest(state: ActorState) -> Point2:
    corners = state.cuboid.footprint()[:, :2]
    ends = np.roll(corners, -1, axis=0) - corners
    share = np.clip(-np.sum(corners * ends, axis=1) / np.sum(ends * ends, axis=1), 0.0, 1.0)
    sides = corners + share[:, None] * ends
    x, y = sides[np.argmin(np.hypot(*sides.T))]
    return float(x), float(y)
