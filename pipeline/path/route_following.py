"""The path along a route: GNSS locates the car on it, and the route ahead is transformed to the ego frame.

Its sigma at distance s combines those of the route, of the fix (which averaging does not reduce, since its error lasts
for minutes), of dead reckoning since the fix, of the heading times s, and the uncertainty after a jump. After a jump,
the route still gives the curvature of the road, but no longer the car's lane.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, isfinite, pi

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64
from pipeline.params import PathParams
from pipeline.path import map_pose as poses
from pipeline.path.estimates import UNKNOWN_SIGMA_M, PathEstimate, samples
from pipeline.path.map_pose import MapPose
from pipeline.path.route_line import SPACING_M, RouteLine, lay_out, to_grid
from pipeline.path.yaw_rate import usable_rate
from pipeline.types import EgoState, GnssFix, Route

_DOUBT_FADES_S = 3.0
_ANEW_DOUBT_FADES_S = 60.0
"""Duration of the doubt after a permanent jump. Causes of jumps by metres, such as reflections or a change of the
correction service, last for minutes, and it is not known whether the old or the new position was wrong."""
_SMALLEST_DOUBT_M = 0.3
"""Below this doubt the car counts as located again."""
_OLDEST_FIX_S = 1.0
"""Older fixes are not extrapolated to the tick."""
_LOST_SIGMA_M = 15.0
"""A less certain pose does not locate the car on a route."""
_LARGEST_TURN_RAD = pi / 3
"""The car does not drive on a stretch of the route at a larger angle to its heading."""
_SEARCH_M = 60.0
"""Search range behind and ahead of the car's last position on the route."""


@dataclass(frozen=True, eq=False)
class GnssState:
    """State of the car's position on the route, from frame to frame."""

    line: RouteLine | None = None
    """The route as a line; None without a route."""
    pose: MapPose | None = None
    """Of the car on the map; None before the first fix with a course."""
    fix_t_ns: int | None = None
    """Time of the last processed fix, so that a repeated fix counts once."""
    fix_sigma_m: float = 0.0
    """Standard deviation of the last accepted fix."""
    doubt_m: float = 0.0
    """Position doubt left by the last jump, decaying."""
    refused_s: float = 0.0
    """How long every fix has been rejected."""
    at_m: float | None = None
    """Distance along the route; None while not on it."""
    placed_anew: bool = False
    """True after a permanent jump, until the doubt has faded."""


def follow(
    state: GnssState,
    route: Route | None,
    fix: GnssFix | None,
    ego: EgoState | None,
    t_ns: int,
    dt_s: float | None,
    params: PathParams,
) -> tuple[GnssState, tuple[str, ...]]:
    """The pose at the frame's tick, and sentences about problems. Does nothing without a route, because then a position
    on the Earth says nothing about the path."""
    if route is None or not params.use_gnss:
        return GnssState(), ()
    line = state.line if state.line is not None and _is_same(state.line.route, route) else lay_out(route)
    if line is None:
        return GnssState(), (f"route {route.name} contains no line",)
    if state.line is not line:
        state = GnssState(line=line)
    state = _dead_reckoned(state, ego, dt_s or 0.0)
    state, notes = _with_fix(state, line, fix, ego, t_ns, dt_s or 0.0, params)
    if state.placed_anew:
        notes = (
            f"GNSS position reset after a jump, uncertain by {state.doubt_m:.1f} m: too inaccurate to tell the lane",
        )
    return state, notes


def _dead_reckoned(state: GnssState, ego: EgoState | None, dt_s: float) -> GnssState:
    """The pose predicted with own speed and yaw rate; without own speed it is lost."""
    if state.pose is None or dt_s <= 0.0:
        return state
    pose = None
    if ego is not None and isfinite(ego.speed_mps):
        pose = poses.predict(state.pose, ego.speed_mps, usable_rate(ego), dt_s, ego.coasting)
    doubt_m = state.doubt_m * exp(-dt_s / (_ANEW_DOUBT_FADES_S if state.placed_anew else _DOUBT_FADES_S))
    placed_anew = state.placed_anew and doubt_m > _SMALLEST_DOUBT_M
    return evolve(state, pose=pose, doubt_m=doubt_m, placed_anew=placed_anew)


def _with_fix(
    state: GnssState,
    line: RouteLine,
    fix: GnssFix | None,
    ego: EgoState | None,
    t_ns: int,
    dt_s: float,
    params: PathParams,
) -> tuple[GnssState, tuple[str, ...]]:
    """Use a new fix, or reject it if it jumped. A fix that was already processed is ignored."""
    if fix is None or fix.t_ns == state.fix_t_ns or not _is_whole(fix):
        return state, ()
    age_s = (t_ns - fix.t_ns) / 1e9
    if not 0.0 <= age_s <= _OLDEST_FIX_S:
        return state, ()
    x, y, convergence = to_grid(line.epsg, fix.lat_deg, fix.lon_deg)
    heading = None
    if fix.course_rad is not None and isfinite(fix.course_rad) and fix.speed_mps >= params.min_speed_mps:
        heading = pi / 2 - (fix.course_rad - convergence)
    scatter_m = poses.white_sigma_m(fix.sigma_m)
    if state.pose is None:
        if heading is None:
            return state, ()
        pose = poses.start(*_moved_on(x, y, heading, fix.speed_mps, age_s), heading, scatter_m)
        return evolve(state, pose=pose, fix_t_ns=fix.t_ns, fix_sigma_m=fix.sigma_m, refused_s=0.0, at_m=None), ()
    speed_mps = ego.speed_mps if ego is not None and ego.coasting is None else fix.speed_mps
    x, y = _moved_on(x, y, float(state.pose.mean[2]), speed_mps, age_s)
    jump = poses.jump_m(state.pose, x, y, scatter_m, params.gnss_gate_sigmas)
    if jump is not None:
        return _refused(state, fix, jump, x, y, dt_s, params)
    pose = poses.with_fix(state.pose, x, y, scatter_m)
    if heading is not None:
        pose = poses.with_course(pose, heading, fix.speed_mps)
    return evolve(state, pose=pose, fix_t_ns=fix.t_ns, fix_sigma_m=fix.sigma_m, refused_s=0.0), ()


def _refused(
    state: GnssState, fix: GnssFix, jump_m: float, x: float, y: float, dt_s: float, params: PathParams
) -> tuple[GnssState, tuple[str, ...]]:
    """A jump does not move the pose but makes it doubtful. If every fix has been rejected for a while, either the pose
    is wrong or the receiver stays wrong: the pose restarts at the fixes, and the doubt remains."""
    assert state.pose is not None
    refused_s, pose = state.refused_s + dt_s, state.pose
    stayed = refused_s >= params.gnss_restart_s
    if stayed:
        pose = poses.start(x, y, float(pose.mean[2]), poses.white_sigma_m(fix.sigma_m))
    kept = evolve(
        state,
        pose=pose,
        fix_t_ns=fix.t_ns,
        doubt_m=max(state.doubt_m, jump_m),
        refused_s=0.0 if stayed else refused_s,
        placed_anew=state.placed_anew or stayed,
    )
    return kept, (f"GNSS jumped by {jump_m:.1f} m: fix ignored",)


def ahead(state: GnssState, params: PathParams) -> tuple[GnssState, PathEstimate | None, tuple[str, ...]]:
    """The route ahead of the car as points in the ego frame; None, with a sentence, if the car is off the route or its
    position is unknown."""
    if state.line is None:
        return state, None, ()
    if state.pose is None:
        return state, None, ("no GNSS fix yet to locate the car on the route",)
    side_var = _sideways_variance(state.pose) + state.fix_sigma_m**2
    if side_var > _LOST_SIGMA_M**2:
        return _at(state, None), None, ("no GNSS fix for too long: position on the route unknown",)
    at_m = _match(state.line, state.pose, state.at_m, params.route_reach_m)
    if at_m is None:
        return _at(state, None), None, ("the car is off the route",)
    s = samples(params.length_m)
    line, (x, y, heading) = state.line, state.pose.mean.tolist()
    steps = np.arange(len(line.places)) * SPACING_M
    away = np.column_stack([np.interp(at_m + s, steps, line.places[:, k]) for k in (0, 1)]) - (x, y)
    c, sn = np.cos(heading), np.sin(heading)
    center = np.column_stack([away[:, 0] * c + away[:, 1] * sn, away[:, 1] * c - away[:, 0] * sn])
    turned = np.interp(at_m + s, steps, line.headings) - np.interp(at_m, steps, line.headings)
    aside, doubt_var = _doubted(center[0, 1], turned, state.doubt_m, params)
    center[:, 1] -= aside
    heading_var = float(state.pose.cov[2, 2])
    sigma = np.sqrt(side_var + line.route.sigma_m**2 + doubt_var + heading_var * s * s)
    sigma = np.where(at_m + s <= steps[-1], sigma, UNKNOWN_SIGMA_M)
    return _at(state, at_m), PathEstimate("gnss", _beyond_the_end(center, s, steps[-1] - at_m), sigma), ()


def _doubted(aside_m: float, turned: F64, doubt_m: float, params: PathParams) -> tuple[float, F64]:
    """How far to shift a route that lies ``aside_m`` to the right of the car, and the variance added by the doubt.

    A doubtful position still shows how the road bends. Laterally, it is weighed against the assumption that cars keep
    to the middle of their lane: in full doubt the route leads through the car. There is no such correction along the
    road: where the route has ``turned``, (N,) radians, since the car's position, an error along the road becomes a
    lateral error.
    """
    keeping_var = params.lane_keeping_sigma_m**2
    believed = keeping_var / (keeping_var + doubt_m**2) if doubt_m > 0.0 else 1.0
    return (1.0 - believed) * aside_m, believed * doubt_m**2 + (doubt_m * np.sin(turned)) ** 2


def _at(state: GnssState, at_m: float | None) -> GnssState:
    return evolve(state, at_m=at_m)


def _match(line: RouteLine, pose: MapPose, last_m: float | None, reach_m: float) -> float | None:
    """Position along the route of the point nearest to the car with the car's direction of travel: a route may cross
    itself, or come back on the other side of the road. Searched near the last match if there is one."""
    x, y, heading = pose.mean.tolist()
    first = 0 if last_m is None else max(0, int((last_m - _SEARCH_M) / SPACING_M))
    last = len(line.places) if last_m is None else min(len(line.places), int((last_m + _SEARCH_M) / SPACING_M) + 1)
    away2 = ((line.places[first:last] - (x, y)) ** 2).sum(axis=1)
    turn = np.abs((line.headings[first:last] - heading + pi) % (2 * pi) - pi)
    away2 = np.where(turn < _LARGEST_TURN_RAD, away2, np.inf)
    if not len(away2) or not away2.min() <= reach_m**2:
        return None
    k = first + int(np.argmin(away2))
    direction = float(line.headings[k])
    px, py = line.places[k]
    along = (x - px) * np.cos(direction) + (y - py) * np.sin(direction)
    return float(np.clip(k * SPACING_M + along, 0.0, (len(line.places) - 1) * SPACING_M))


def _sideways_variance(pose: MapPose) -> float:
    """Variance of the position across the car's heading."""
    n = np.array([-np.sin(pose.mean[2]), np.cos(pose.mean[2])])
    return float(n @ pose.cov[:2, :2] @ n)


def _beyond_the_end(center: F64, s: F64, left_m: float) -> F64:
    """Extends the route straight beyond its end, so that its points stay distinct; their sigma marks them as
    unusable."""
    over = np.maximum(s - left_m, 0.0)
    if not over.any():
        return center
    last = int(np.argmax(over > 0.0)) - 1
    back = max(last - 2, 0)
    way = center[last] - center[back] if last > back else np.array([1.0, 0.0])
    way = way / max(float(np.hypot(*way)), 1e-9)
    return np.where(over[:, None] > 0.0, center[last] + (s - s[last])[:, None] * way, center)


def _moved_on(x: float, y: float, heading: float, speed_mps: float, age_s: float) -> tuple[float, float]:
    """The position of an older fix, extrapolated to now."""
    return x + speed_mps * age_s * float(np.cos(heading)), y + speed_mps * age_s * float(np.sin(heading))


def _is_same(a: Route, b: Route) -> bool:
    return a is b or (np.array_equal(a.lat_deg, b.lat_deg) and np.array_equal(a.lon_deg, b.lon_deg))


def _is_whole(fix: GnssFix) -> bool:
    return isfinite(fix.lat_deg) and isfinite(fix.lon_deg) and isfinite(fix.sigma_m) and isfinite(fix.speed_mps)
