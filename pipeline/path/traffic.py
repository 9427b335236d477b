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
from math import hypot
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
_CAMERA_LINK_M = 10.0
"""The same if only the camera sees it: at 45 m its lateral position is uncertain by 0.2 m, its distance by 3 m."""
_CAMERA_EXISTS = 0.9
"""Minimum probability of existing of a vehicle that only the camera sees."""
_KEPT_S, _BEHIND_M = 20.0, -10.0
_USUAL_TIME_S = 3.0
"""Time ahead over which the curvature changes as much as the lateral jerk of roads permits."""
_WIDEST_RAD = 1.2
"""Larger bearings count as this one: a point beside or behind the car lies at the end of no endless arc."""


@dataclass(frozen=True, eq=False)
class TrafficState:
    """State from one frame to the next: past positions of vehicles, newest last."""

    xy: F64
    """(N, 2) ego x, y."""
    age_s: F64
    """(N,)"""
    vehicle: I64
    """(N,) LiDAR track, or minus one minus the vision track while only the camera sees it."""


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
        number = _number(item)
        if number is not None:
            kept = _with(kept, item, number, ego)
    seen = _headings(kept.xy, kept.age_s, kept.vehicle)
    return kept, Traffic(_along(seen, ego, params), seen) if len(seen) else None


def warm_up() -> None:
    """Compile the kernels, or load them from numba's cache."""
    _headings(NONE.xy, NONE.age_s, NONE.vehicle)
    _smooth(np.zeros(2), np.ones(2), 2, STEP_M, 1e-4, np.ones(3))


def _moved(state: TrafficState, ego: EgoState, dt_s: float) -> TrafficState:
    """The stored positions, transformed to now."""
    xy = now_at(state.xy, ego, dt_s)
    age_s = state.age_s + dt_s
    keep = (xy[:, 0] > _BEHIND_M) & (age_s <= _KEPT_S)
    return TrafficState(xy[keep], age_s[keep], state.vehicle[keep])


def _number(item: FusedObject) -> int | None:
    """Of a vehicle whose way shows the road: one named by the camera and measured by the LiDAR, or one that the camera
    alone has followed for so long that it certainly drives. None for any other object."""
    if item.label not in VEHICLES:
        return None
    if item.seen_by_lidar:
        return item.lidar_track
    is_sure = item.seen_by_camera and item.measured and item.surely_moving and (item.existence or 0.0) >= _CAMERA_EXISTS
    return -1 - item.vision_track if is_sure and not item.ranged and item.vision_track is not None else None


def _with(state: TrafficState, item: FusedObject, number: int, ego: EgoState) -> TrafficState:
    """Adds the current position of a vehicle if it moves and its velocity agrees with its positions."""
    if item.bev is None or item.velocity_mps is None:
        return state
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = item.bev
    x, y = (ax + bx + cx + dx) / 4.0, (ay + by + cy + dy) / 4.0
    rate = ego.yaw_rate_radps or 0.0
    along_mps, across_mps = item.velocity_mps[0] + ego.speed_mps - rate * y, item.velocity_mps[1] + rate * x
    mine = state.vehicle == number
    rows = np.flatnonzero(mine)
    if len(rows):
        (last_x, last_y), waited_s = state.xy[rows[-1]].tolist(), float(state.age_s[rows[-1]])
        moved_x, moved_y = x - last_x, y - last_y
        moved_m = hypot(moved_x, moved_y)
        if moved_m < _POINT_M and hypot(along_mps, across_mps) * waited_s < _LINK_M:
            return state
        off_x, off_y = moved_x - along_mps * waited_s, moved_y - across_mps * waited_s
        off_m = hypot(off_x, off_y)
        if not item.ranged_now:  # the distance of a box wavers by far more than its direction
            off_m = max(abs(off_y * x - off_x * y) / max(hypot(x, y), 1.0), off_m - (item.distance_sigma_m or 0.0))
        if off_m > _STRAYS_M + _STRAYS * moved_m:
            others = ~mine  # it is now a different vehicle, or never drove
            state = TrafficState(state.xy[others], state.age_s[others], state.vehicle[others])
    return TrafficState(
        np.concatenate([state.xy, [(x, y)]]),
        np.concatenate([state.age_s, [0.0]]),
        np.concatenate([state.vehicle, [number]]),
    )


@numba.njit(cache=True, nogil=True)
def _headings(xy, age_s, vehicle):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(N, 3) x, y and heading of each link of every vehicle's way ahead of the car, by vehicle, newest first; headings
    of oncoming vehicles are reversed. A vehicle that has turned off has none; links driven too slowly are left out."""
    found = np.empty((len(xy), 3))
    count = 0
    for number in np.unique(vehicle):
        rows = np.flatnonzero(vehicle == number)
        first, last = count, rows[-1]
        for k in rows[:-1][::-1]:
            dx, dy = xy[last, 0] - xy[k, 0], xy[last, 1] - xy[k, 1]
            way_m = np.hypot(dx, dy)
            if way_m < (_LINK_M if number >= 0 else _CAMERA_LINK_M):
                continue
            x, y = 0.5 * (xy[last, 0] + xy[k, 0]), 0.5 * (xy[last, 1] + xy[k, 1])
            heading = np.arctan2(dy, dx)
            heading -= np.pi * np.rint(heading / np.pi)
            if way_m / max(age_s[k] - age_s[last], 1e-3) >= _SLOWEST_MPS and x > 0.0:
                if max(abs(heading), abs(heading - 2.0 * np.arctan2(y, x))) > _TURNED_OFF_RAD:
                    count = first
                    break
                found[count, 0], found[count, 1], found[count, 2] = x, y, heading
                count += 1
            last = k
    return found[:count].copy()


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
    half = 0.5 * ds * ds
    noise = (ds**5 / 20.0, ds**4 / 8.0, ds**3 / 6.0, ds**3 / 3.0, half, ds)
    means, covs = np.zeros((size, 3)), np.zeros((size, 3, 3))
    before, before_cov = np.zeros((size, 3)), np.zeros((size, 3, 3))
    for k in range(size):
        mean, cov = before[k], before_cov[k]
        if k:
            last, last_cov = means[k - 1], covs[k - 1]
            mean[0], mean[1] = last[0] + ds * last[1] + half * last[2], last[1] + ds * last[2]
            mean[2] = last[2]
            _move(last_cov, ds, half, cov)
            cov[0, 0] += density * noise[0]
            cov[0, 1] += density * noise[1]
            cov[0, 2] += density * noise[2]
            cov[1, 1] += density * noise[3]
            cov[1, 2] += density * noise[4]
            cov[2, 2] += density * noise[5]
            cov[1, 0], cov[2, 0], cov[2, 1] = cov[0, 1], cov[0, 2], cov[1, 2]
        else:
            for i in range(3):
                cov[i, i] = start[i] * start[i]
        spread = cov[1, 1] + HEADING_SIGMA_RAD**2 / count[k] if count[k] > 0.0 else np.inf
        off = total[k] / count[k] - mean[1] if count[k] > 0.0 else 0.0
        for i in range(3):
            gain = cov[i, 1] / spread
            means[k, i] = mean[i] + gain * off
            for j in range(3):
                covs[k, i, j] = cov[i, j] - gain * cov[1, j]
    back, turned, change = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    for k in range(size - 2, -1, -1):
        for i in range(3):
            # the row of cov @ F.T, from which the gain is found by solving with the covariance before the next node
            cov = covs[k]
            turned[i, 0], turned[i, 1] = cov[i, 0] + ds * cov[i, 1] + half * cov[i, 2], cov[i, 1] + ds * cov[i, 2]
            turned[i, 2] = cov[i, 2]
        _solve(before_cov[k + 1], turned, back)
        for i in range(3):
            for j in range(3):
                means[k, i] += back[i, j] * (means[k + 1, j] - before[k + 1, j])
                change[i, j] = 0.0
                for m in range(3):
                    change[i, j] += back[i, m] * (covs[k + 1, m, j] - before_cov[k + 1, m, j])
        for i in range(3):
            for j in range(3):
                for m in range(3):
                    covs[k, i, j] += change[i, m] * back[j, m]
    return means[:, 1].copy(), np.sqrt(np.maximum(covs[:, 0, 0], 0.0))


@numba.njit(cache=True, nogil=True)
def _move(cov, ds, half, out):  # type: ignore[no-untyped-def]  # pragma: no cover
    """F cov Fᵀ of a covariance (3, 3) of lateral position, heading and curvature, ``ds`` further along the road."""
    for j in range(3):
        out[0, j] = cov[0, j] + ds * cov[1, j] + half * cov[2, j]
        out[1, j] = cov[1, j] + ds * cov[2, j]
        out[2, j] = cov[2, j]
    for i in range(3):
        out[i, 0] = out[i, 0] + ds * out[i, 1] + half * out[i, 2]
        out[i, 1] = out[i, 1] + ds * out[i, 2]


@numba.njit(cache=True, nogil=True)
def _solve(a, b, out):  # type: ignore[no-untyped-def]  # pragma: no cover
    """out = b a⁻¹ for a symmetric positive definite a (3, 3), by its Cholesky factor."""
    l00 = np.sqrt(a[0, 0])
    l10, l20 = a[1, 0] / l00, a[2, 0] / l00
    l11 = np.sqrt(a[1, 1] - l10 * l10)
    l21 = (a[2, 1] - l20 * l10) / l11
    l22 = np.sqrt(a[2, 2] - l20 * l20 - l21 * l21)
    for i in range(3):
        y0 = b[i, 0] / l00
        y1 = (b[i, 1] - l10 * y0) / l11
        y2 = (b[i, 2] - l20 * y0 - l21 * y1) / l22
        out[i, 2] = y2 / l22
        out[i, 1] = (y1 - l21 * out[i, 2]) / l11
        out[i, 0] = (y0 - l10 * out[i, 1] - l20 * out[i, 2]) / l00
