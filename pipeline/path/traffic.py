"""The path shown by other vehicles: their headings show where the road goes.

A car that drives straight on 25 m ahead shows that the road is straight there, whichever its lane and direction. Its
earlier positions show the same for the road in between. On a road without lines or a route, and for the next bend,
which the ego yaw rate cannot predict, no other source gives as much information.

Headings are stored at the positions where they were seen, moved by ego motion, and combined by a Kalman smoother along
the road (Rauch, Tung and Striebel 1965): the curvature of a road is a random walk, its heading the integral of the
curvature, and its position the integral of the heading. The ego lane begins at the car, in its direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np

from pipeline.common.geometry import F64
from pipeline.params import PathParams
from pipeline.path.estimates import SHARPEST_BEGIN_PER_M2, STEP_M, TIGHTEST_CURVATURE_PER_M, PathEstimate, samples
from pipeline.path.ground_points import now_at
from pipeline.types import I64, VEHICLES, EgoState, FusedObject, Moment

HEADING_SIGMA_RAD = 0.1
"""The heading during a lane change at 10 m/s that takes some three seconds: a vehicle's heading indicates the road's
direction no more accurately."""
_LINK_M = 5.0
"""A vehicle counts as driven once it has moved by this much over ground: more than its length, by which the measured
position of a parked vehicle may shift while the car passes."""
_POINT_M = 1.0
"""Minimum distance between stored positions of one vehicle."""
_STRAYS_M, _STRAYS = 0.5, 0.2
"""Maximum deviation of a vehicle's positions from what its velocity implies, absolute and as a share of the way. A
track that jumps from one parked car to the next exceeds it."""
_SLOWEST_MPS = 4.0
"""A vehicle slower over ground may be parking or turning off."""
_TURNED_OFF_RAD = 0.6
"""A vehicle whose direction differs by more than this from the car's, or from that of the arc that leads to it, is
treated as crossing or leaving the road: a bend of 50 m radius turns by this much over 30 m. At 25 m, a bend of 30 m
radius that begins half way turns a car in it by 0.2 rad from that arc, one in the next lane by 0.3 rad."""
_KEPT_S, _BEHIND_M = 20.0, -10.0
_USUAL_TIME_S = 3.0
"""Time ahead over which the curvature changes as much as the lateral jerk of roads permits."""
_WIDEST_RAD = 1.2


@dataclass(frozen=True, eq=False)
class TrafficState:
    """State from one frame to the next: past positions of vehicles, newest last."""

    xy: F64
    """(N, 2) ego x, y."""
    age_s: F64
    """(N,)"""
    vehicle: I64
    """(N,) LiDAR track."""


NONE = TrafficState(np.zeros((0, 2)), np.zeros(0), np.zeros(0, np.int64))


class Traffic(NamedTuple):
    """The course of the road from the vehicles on it."""

    path: PathEstimate
    """The path from the car along their headings."""
    headings: F64
    """(N, 3) ego x, y, heading in rad: the input of ``path``."""


def follow(
    state: TrafficState, objects: Sequence[FusedObject], now: Moment, params: PathParams
) -> tuple[TrafficState, Traffic | None]:
    """One frame. None without own motion, which is needed to distinguish moving from standing vehicles, and if no
    vehicle has driven yet."""
    ego, dt_s = now.ego, now.dt_s
    if ego is None or not params.use_traffic:
        return NONE, None
    kept = _moved(state, ego, dt_s) if dt_s else NONE
    for item in objects:
        kept = _with(kept, item, ego)
    headings = [row for vehicle in np.unique(kept.vehicle).tolist() for row in _headings(kept, vehicle)]
    if not headings:
        return kept, None
    seen = np.array(headings)
    return kept, Traffic(_along(seen, ego, params), seen)


def warm_up() -> None:
    """Compile the kernel."""
    _smooth(np.zeros(2), np.ones(2), 2, STEP_M, 1e-4, np.ones(3))


def _moved(state: TrafficState, ego: EgoState, dt_s: float) -> TrafficState:
    """The stored positions, transformed to now."""
    xy = now_at(state.xy, ego, dt_s)
    age_s = state.age_s + dt_s
    keep = (xy[:, 0] > _BEHIND_M) & (age_s <= _KEPT_S)
    return TrafficState(xy[keep], age_s[keep], state.vehicle[keep])


def _with(state: TrafficState, item: FusedObject, ego: EgoState) -> TrafficState:
    """Adds the current position of a vehicle if it moves: it must be classified by the camera and measured by the
    LiDAR, and its velocity must agree with its positions."""
    if not item.seen_by_lidar or item.label not in VEHICLES or item.lidar_track is None:
        return state
    if item.bev is None or item.velocity_mps is None:
        return state
    x, y = place = np.mean(item.bev, axis=0)
    rate = ego.yaw_rate_radps or 0.0
    velocity = np.array([item.velocity_mps[0] + ego.speed_mps - rate * y, item.velocity_mps[1] + rate * x])
    mine = state.vehicle == item.lidar_track
    if mine.any():
        moved, waited_s = place - state.xy[mine][-1], state.age_s[mine][-1]
        if np.hypot(*moved) < _POINT_M and np.hypot(*velocity) * waited_s < _LINK_M:
            return state
        if np.hypot(*(moved - velocity * waited_s)) > _STRAYS_M + _STRAYS * np.hypot(*moved):
            mine = ~mine  # it is now a different vehicle, or never drove
            state = TrafficState(state.xy[mine], state.age_s[mine], state.vehicle[mine])
    return TrafficState(
        np.vstack([state.xy, place]), np.append(state.age_s, 0.0), np.append(state.vehicle, item.lidar_track)
    )


def _headings(state: TrafficState, vehicle: int) -> list[tuple[float, float, float]]:
    """x, y and heading of each link of one vehicle's way ahead of the car, newest first; headings of oncoming vehicles
    are reversed. Empty for a vehicle that has turned off; links driven too slowly are left out."""
    mine = state.vehicle == vehicle
    xy, age_s = state.xy[mine], state.age_s[mine]
    found: list[tuple[float, float, float]] = []
    last = len(xy) - 1
    for k in range(last - 1, -1, -1):
        dx, dy = (xy[last] - xy[k]).tolist()
        way_m = float(np.hypot(dx, dy))
        if way_m < _LINK_M:
            continue
        x, y = (0.5 * (xy[last] + xy[k])).tolist()
        heading = float(np.arctan2(dy, dx))
        heading -= np.pi * round(heading / np.pi)
        if way_m / max(age_s[k] - age_s[last], 1e-3) >= _SLOWEST_MPS:
            if x > 0.0 and max(abs(heading), abs(heading - 2.0 * np.arctan2(y, x))) > _TURNED_OFF_RAD:
                return []
            if x > 0.0:
                found.append((x, y, heading))
        last = k
    return found


def _along(seen: F64, ego: EgoState, params: PathParams) -> PathEstimate:
    """The road ahead of the car, from (N, 3) headings. Each applies at the arc length to its position."""
    s, speed = samples(params.length_m), max(ego.speed_mps, params.min_speed_mps, 0.1)
    aside = np.clip(np.arctan2(seen[:, 1], seen[:, 0]), -_WIDEST_RAD, _WIDEST_RAD)
    reached = np.hypot(seen[:, 0], seen[:, 1]) / np.sinc(aside / np.pi)
    at = np.clip(np.round(reached / STEP_M).astype(np.intp), 0, len(s) - 1)
    # headings at one position are averaged and count as one measurement
    count = np.bincount(at, minlength=len(s)).astype(np.float64)
    total = np.bincount(at, weights=seen[:, 2], minlength=len(s))
    begins = min(params.lateral_jerk_mps3 / speed**3, SHARPEST_BEGIN_PER_M2)
    start = np.array(
        [
            params.lane_keeping_sigma_m,
            params.lane_keeping_sigma_mps / speed,
            min(params.lateral_accel_mps2 / speed**2, TIGHTEST_CURVATURE_PER_M),
        ]
    )
    theta, sigma_m = _smooth(total, count, len(s), STEP_M, begins**2 * speed * _USUAL_TIME_S, start)
    between = 0.5 * (theta[1:] + theta[:-1])
    center = np.zeros((len(s), 2))
    center[1:, 0], center[1:, 1] = np.cumsum(np.cos(between)) * STEP_M, np.cumsum(np.sin(between)) * STEP_M
    return PathEstimate("traffic", center, sigma_m)


@numba.njit(cache=True, nogil=True)
def _smooth(total, count, size, ds, density, start):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(size,) heading and sigma of the lateral position along the road. The state is (lateral position, heading,
    curvature), where the curvature is a random walk of ``density`` 1/m³. total, count: (size,) sum and number of
    headings at each length. start: (3,) sigmas at the car, around zero."""
    F = np.array([[1.0, ds, 0.5 * ds * ds], [0.0, 1.0, ds], [0.0, 0.0, 1.0]])
    Q = density * np.array(
        [
            [ds**5 / 20.0, ds**4 / 8.0, ds**3 / 6.0],
            [ds**4 / 8.0, ds**3 / 3.0, ds * ds / 2.0],
            [ds**3 / 6.0, ds * ds / 2.0, ds],
        ]
    )
    means, covs = np.zeros((size, 3)), np.zeros((size, 3, 3))
    before, before_cov = np.zeros((size, 3)), np.zeros((size, 3, 3))
    mean, cov = np.zeros(3), np.diag(start * start)
    for k in range(size):
        if k:
            mean, cov = F @ mean, F @ cov @ F.T + Q
        before[k], before_cov[k] = mean, cov
        if count[k] > 0.0:
            gain = cov[:, 1] / (cov[1, 1] + HEADING_SIGMA_RAD**2 / count[k])
            mean = mean + gain * (total[k] / count[k] - mean[1])
            cov = cov - np.outer(gain, cov[1])
        means[k], covs[k] = mean, cov
    for k in range(size - 2, -1, -1):
        back = covs[k] @ F.T @ np.linalg.inv(before_cov[k + 1])
        means[k] = means[k] + back @ (means[k + 1] - before[k + 1])
        covs[k] = covs[k] + back @ (covs[k + 1] - before_cov[k + 1]) @ back.T
    return means[:, 1].copy(), np.sqrt(np.maximum(covs[:, 0, 0], 0.0))
