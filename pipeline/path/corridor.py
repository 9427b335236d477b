"""The ego corridor: where the car is going, as a centre line with a left and a right edge (paper, section CIPV).

    lane lines ───────────┐
    GNSS on a route ──────┤
    yaw rate's arc ───────┼─► compare, weigh ─► blend with the frame before ─► Path
    the road's edges ─────┤
    other vehicles ───────┤
    the drivable area ────┤
    (else straight ahead) ┘

The paper uses lane centres on straights and a GPS path in curves, chosen by hand. Here, every source gives its sigma at
each distance, and the sigmas decide. The previous frame's path, moved by ego motion, is one of the inputs, so the path
does not jump when a source appears or disappears."""

from __future__ import annotations

from dataclasses import dataclass
from math import erf, exp, isfinite, pi, sqrt
from typing import NamedTuple

import numba
import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64
from pipeline.params import PathParams
from pipeline.path import blend_estimates, yaw_rate
from pipeline.path import route_following as gnss
from pipeline.path.blend_estimates import FusedPath
from pipeline.path.estimates import SOURCES, STEP_M, PathEstimate, between_lines, corner_m, straight
from pipeline.path.route_following import GnssState
from pipeline.path.yaw_rate import YawRate
from pipeline.types import EgoState, GnssFix, Moment, Path, PathSource, Route
from pipeline.types.lane import EgoLane

_LOOK_AHEAD_M = (10, 30, 60)
_CARRIES_ALONE = 0.7
"""Share at 30 m from which the path is named after a single source."""
_NO_SHARE = 0.005
"""Smaller shares are not reported."""
_FASTEST_SHIFT_MPS = 3.0
"""Largest lateral speed of any point of the corridor, plus its uncertainty: a lane change takes a second."""
_USABLE_WITHOUT_SPEED_M, _USABLE_AT_STANDSTILL_M = 20.0, 5.0
"""How far ahead a path must be known if the speed is unknown, or so low that ``usable_s`` times the speed is too
short."""


@dataclass(frozen=True, eq=False)
class PathState:
    """State from one frame to the next."""

    yaw: YawRate | None = None
    """Smoothed yaw rate; None before the first."""
    gnss: GnssState = GnssState()
    """The car's position on the route."""
    last: FusedPath | None = None
    """The fused path; None if nothing can be carried over."""
    is_shown: bool = False
    """Whether lane lines or a route showed the course of the road."""


class Evidence(NamedTuple):
    """Sources of the path other than own motion; each may be missing."""

    lane: EgoLane | None = None
    """The painted lines on both sides."""
    fix: GnssFix | None = None
    """Position of the car on the Earth, if a fix came with this frame."""
    route: Route | None = None
    """The route that the car follows."""
    edges: PathEstimate | None = None
    """The path along structures beside the road."""
    traffic: PathEstimate | None = None
    """The path along the headings of other vehicles."""
    drivable: PathEstimate | None = None
    """The path along the drivable area in the image."""


def predict(state: PathState, evidence: Evidence, now: Moment, params: PathParams) -> tuple[PathState, Path]:
    """The path ahead, from the available sources. With none, the path is straight, with a correspondingly large sigma.
    It keeps using ``now.motion``, however old, until its own sigma makes it unusable."""
    ego = now.motion if now.motion is not None and isfinite(now.motion.speed_mps) else None
    dt_s = now.dt_s

    # Each source gives the path and its uncertainty at each distance
    yaw = yaw_rate.follow(state.yaw, ego, dt_s, params) if params.use_yaw_rate else None
    placed, wrong_fix = gnss.follow(state.gnss, evidence.route, evidence.fix, ego, now.t_ns, dt_s, params)
    placed, along_route, wrong_route = gnss.ahead(placed, params)
    surest = (between_lines(evidence.lane, params) if params.use_lanes else None, along_route)
    seen = (*surest, yaw_rate.ahead(yaw, ego, params))
    estimates = [each for each in seen if each is not None]
    is_shown = any(_shows_the_road(each, params) for each in surest)
    if not is_shown:
        estimates += [each for each in (evidence.edges, evidence.traffic, evidence.drivable) if each is not None]
    guess = straight(ego, params)
    if all(each.sigma_m[0] > guess.sigma_m[0] for each in estimates) or _fades(ego, estimates):
        # for the next metres, a vague route is worse than the assumption that the car continues in its direction
        estimates.append(guess)

    # Sources are compared with each other and with the last path, predicted to now; outliers are left out, the rest is
    # averaged
    expected = _expected(state.last, yaw, ego, dt_s, len(estimates[0].center))
    fresh, left_out = blend_estimates.fuse(estimates, expected, params.half_width_m, params.outlier_sigmas)

    # The previous path is blended in, so that nothing jumps when a source appears or disappears
    path = fresh
    if expected is not None and dt_s:
        keep = exp(-dt_s / params.smoothing_s) if params.smoothing_s > 0.0 else 0.0
        path = blend_estimates.blend(fresh, expected, keep, _FASTEST_SHIFT_MPS * dt_s)
    notes = (*_about_own_motion(ego), *wrong_fix, *wrong_route, *left_out)
    shown = _as_path(path, ego, notes, params)
    if params.use_corners and not is_shown:
        shown = evolve(shown, corner_m=corner_m(ego, params))
    return PathState(yaw, placed, path if ego is not None else None, is_shown), shown


def corridor(ego: EgoState | None, params: PathParams) -> Path:
    """The path from own motion alone, without lane lines, route or history."""
    return predict(PathState(), Evidence(), Moment(0, None, ego, ego), params)[1]


def warm_up() -> None:
    """Compile the path's kernels with two frames of a synthetic drive along a route."""
    place = np.array([0.0, 0.001])
    route, params, state = Route("warm-up", place, place, 0.01), PathParams(), PathState()
    for k in range(2):
        t_ns = k * 100_000_000
        fix = GnssFix(t_ns, k * 6.4e-6, k * 6.4e-6, 0.0, pi / 4, 10.0, "rtk_fixed", 0.01)
        ego = EgoState(t_ns, 10.0, 0.0)
        now = Moment(t_ns, 0.1 if k else None, ego, ego)
        state, path = predict(state, Evidence(None, fix, route), now, params)
    nearest_on_path(path, np.zeros((1, 2)))


def _shows_the_road(each: PathEstimate | None, params: PathParams) -> bool:
    """Whether lane lines or a route show the road well. Then road edges and other vehicles add nothing and must not
    outvote them: a car keeps to its lane where the kerb diverges or other vehicles turn off."""
    if each is None:
        return False
    ahead = min(int(_LOOK_AHEAD_M[1] / STEP_M), len(each.sigma_m) - 1)  # a path may be shorter
    return float(each.sigma_m[ahead]) <= params.good_sigma_m


def _expected(
    last: FusedPath | None, yaw: YawRate | None, ego: EgoState | None, dt_s: float | None, size: int
) -> FusedPath | None:
    """The last path, predicted to now; None without a last path or own motion."""
    if last is None or ego is None or not dt_s or len(last.center) != size:
        return None
    rate = yaw_rate.usable_rate(ego)
    if rate is None and yaw is not None:
        rate = yaw.rate_radps
    if rate is None:
        return None
    return blend_estimates.moved(last, max(ego.speed_mps, 0.0) * dt_s, rate * dt_s, dt_s, ego.coasting)


def _fades(ego: EgoState | None, estimates: list[PathEstimate]) -> bool:
    """Whether own motion is no longer measured and no line shows the road. Then a straight guess gradually takes over
    as yaw rate and pose become less certain."""
    return ego is not None and ego.coasting is not None and all(each.source != "lane" for each in estimates)


def _about_own_motion(ego: EgoState | None) -> tuple[str, ...]:
    if ego is not None and ego.coasting is not None:
        return (f"ego speed not measured for {ego.coasting.age_s:.1f} s: assuming {ego.speed_mps * 3.6:.0f} km/h",)
    return ()


def _as_path(path: FusedPath, ego: EgoState | None, notes: tuple[str, ...], params: PathParams) -> Path:
    normal = blend_estimates.normals(path.center)
    sigma_m = np.hypot(path.sigma_m, path.behind_m)
    at = np.minimum(np.array(_LOOK_AHEAD_M) / STEP_M, len(path.center) - 1).astype(np.intp)
    shares = path.shares[at]
    reach_m, needed_m = _reach_m(sigma_m, params), _needed_m(ego, params)
    needed_sigma_m = float(sigma_m[min(int(needed_m / STEP_M), len(sigma_m) - 1)])
    usable = reach_m >= min(needed_m, params.length_m)
    if not usable:
        notes = (*notes, f"the path is reliable for only {max(reach_m, 0.0):.0f} m ahead")
    return Path(
        source=_carrier(shares[1]),
        center=path.center,
        left=path.center + path.left_m[:, None] * normal,
        right=path.center - path.right_m[:, None] * normal,
        half_width_m=params.half_width_m,
        sigma_m={f"{s}": float(sigma) for s, sigma in zip(_LOOK_AHEAD_M, sigma_m[at].tolist(), strict=True)},
        weights=_by_source(shares.mean(axis=0)),
        profile_m=sigma_m,
        carried_by={f"{s}": _by_source(row) for s, row in zip(_LOOK_AHEAD_M, shares, strict=True)},
        reach_m=max(reach_m, 0.0),
        usable=usable,
        doubt="" if usable else f"path known only {max(reach_m, 0.0):.0f} m ahead",
        confidence=erf(params.half_width_m / needed_sigma_m / sqrt(2.0)) if needed_sigma_m > 0.0 else 1.0,
        notes=notes,
    )


def _by_source(shares: F64) -> dict[str, float]:
    """(S,) shares of ``SOURCES`` by name."""
    return {str(name): share for name, share in zip(SOURCES, shares.tolist(), strict=True) if share > _NO_SHARE}


def _carrier(shares: F64) -> PathSource:
    """The source that the path is named after, from (S,) shares of ``SOURCES``."""
    main = int(np.argmax(shares))
    return SOURCES[main] if shares[main] >= _CARRIES_ALONE else "fused"


def _reach_m(sigma_m: F64, params: PathParams) -> float:
    """How far ahead the path is accurate enough to drive by, from (K,) sigmas; negative if nowhere."""
    too_vague = np.flatnonzero(~(sigma_m <= params.good_sigma_m))
    return float(too_vague[0] - 1) * STEP_M if len(too_vague) else params.length_m


def _needed_m(ego: EgoState | None, params: PathParams) -> float:
    """How far ahead a path must be known to drive by it."""
    if ego is None:
        return _USABLE_WITHOUT_SPEED_M
    return max(params.usable_s * ego.speed_mps, _USABLE_AT_STANDSTILL_M)


def offset(path: Path, points: F64) -> F64:
    """(N,) signed distance of (N, 2) ego points from the path's centre line, positive to the left of it."""
    return nearest_on_path(path, points)[0]


def nearest_on_path(path: Path, points: F64) -> tuple[F64, F64]:
    """Signed offset (N,) and path length (N,) of each point's foot on the centre line. Points before the first or
    beyond the last segment are measured relative to the extension of that segment."""
    return nearest(path.center, np.asarray(points, dtype=np.float64))


@numba.njit(cache=True, nogil=True)
def nearest(center, points):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Kernel of ``nearest_on_path``, also used by other kernels: the nearest foot wins, the first one if several are
    equal."""
    pieces = len(center) - 1
    # one array per column, so that the loop can be vectorised
    x, y, dx, dy = np.empty(pieces), np.empty(pieces), np.empty(pieces), np.empty(pieces)
    first, last, along = np.zeros(pieces), np.empty(pieces), np.zeros(pieces + 1)
    for k in range(pieces):
        x[k], y[k] = center[k, 0], center[k, 1]
        wx, wy = center[k + 1, 0] - x[k], center[k + 1, 1] - y[k]
        last[k] = np.sqrt(wx * wx + wy * wy)
        dx[k], dy[k] = wx / last[k], wy / last[k]
        along[k + 1] = along[k] + last[k]
    first[0], last[-1] = -np.inf, np.inf  # the first and last segment extend to infinity
    offset, reached, away2 = np.empty(len(points)), np.empty(len(points)), np.empty(pieces)
    for n in range(len(points)):
        px, py = points[n, 0], points[n, 1]
        least = _away2(x, y, dx, dy, first, last, px, py, away2)
        k = 0
        while k < pieces - 1 and away2[k] > least:
            k += 1
        rx, ry = px - x[k], py - y[k]
        side = 1.0 if dx[k] * ry - dy[k] * rx >= 0.0 else -1.0
        offset[n] = side * np.sqrt(least)
        reached[n] = along[k] + min(max(rx * dx[k] + ry * dy[k], first[k]), last[k])
    return offset, reached


# No branch and nothing that can raise, so the compiler vectorises it; testing every segment is then faster than
# selecting the segments to test.


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz", "contract", "reassoc"})
def _away2(x, y, dx, dy, first, last, px, py, out):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Writes the squared distance of a point from each segment of the line into ``out``; returns the smallest."""
    least = np.inf
    for k in range(len(x)):
        rx, ry = px - x[k], py - y[k]
        t = min(max(rx * dx[k] + ry * dy[k], first[k]), last[k])
        ex, ey = rx - t * dx[k], ry - t * dy[k]
        out[k] = ex * ex + ey * ey
        least = min(least, out[k])
    return least
