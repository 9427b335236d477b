"""Tracks lane lines from frame to frame: a Kalman filter on each line's polynomial, moved by ego motion.

A line y(x) seen from a car that has driven Δs and turned by Δψ is y(x + Δs) − x·Δψ − Δs·Δψ/2: linear in the
coefficients, so prediction is exact for small turns. Every line near the car is tracked, not only the two of the ego
lane, so in a lane change the lines pass through and the ego lane is simply another pair of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numba
import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64
from pipeline.lanes.line_fit import FittedLine, RoadCurve
from pipeline.params import LaneParams
from pipeline.types import EgoState
from pipeline.types.lane import EgoLane, LaneLine, Side, powers

Line = TypeVar("Line", "LineTrack", FittedLine)
_COMPARE_AT = powers([5.0, 15.0])
_SIDE_AT_M = 4.0
"""Distance ahead at which a line counts as left or right of the car: about the front wheels."""
_OVER_M = 20.0
_PLACES = powers([_SIDE_AT_M, 0.0, _OVER_M / 2, _OVER_M])
_CAR_HALF_M = 0.9
"""If the whole car is inside a lane, the lane's line is no farther than the widest lane minus this."""
_MOST_UNPARALLEL, _USUALLY_UNPARALLEL = 0.05, 0.02
"""Maximum and usual difference in slope between a lane's two lines."""
_FURTHEST_M = 5.0
_USUAL_WIDTH_M = 3.5
_USUALLY_OFF_MIDDLE_M = 0.7
_SEEN_GAIN = 0.35
"""Weight of a new measurement in a line's quality."""
_FADE_S = 0.8
"""Time in which the quality of an unseen line falls to a third."""
_FORGOTTEN = 0.1
_SETTLED = 10
"""Number of images in which a line was seen, after which images of the same place say nothing new of it: their errors
are the same, and would only make a wrong line look certain."""
_UNKNOWN_DRIFT_MPS = 0.5
"""Lateral speed of lines assumed if own motion is not known."""
_YAW_RATE_SIGMA_RADPS = 0.01
_UNKNOWN_YAW_RATE_RADPS = 0.06
_UNKNOWN_SPEED_MPS = 20.0
_NOT_CUBIC = np.diag(np.square([0.03, 1e-3, 1e-4, 4e-6]))
"""Covariance that remains however often a line is seen, because roads are neither cubics nor planes. Tuned so that in
the simulator's S-curve 95 % of the lines lie within 2.5 sigma at 30 m."""
_CLOTHOID_PER_M2 = 1.0 / 150.0**2
"""Rate of change of a road's curvature: a clothoid of parameter A = 150 m, as in a road for 80 km/h."""


@dataclass(frozen=True, eq=False)
class LineTrack:
    """One tracked line."""

    coefficients: F64
    """(4,) of the cubic y(x) in the ego frame, metres."""
    covariance: F64
    """(4, 4) of the coefficients."""
    x_min_m: float
    """Smallest x at which the line was seen."""
    x_max_m: float
    """Largest x at which the line was seen."""
    quality: float
    """0–1; fades while the line is not seen."""
    seen: int = 1
    """Number of images in which it was seen."""
    unseen_s: float = 0.0
    """Time since it was last seen."""


@dataclass(frozen=True, eq=False)
class LaneTracks:
    """Every tracked line."""

    lines: tuple[LineTrack, ...] = ()
    """In no particular order."""
    source: str | None = None
    """The detector's name; None before its first result."""
    age_s: float = 0.0
    """Time since its last result."""


def predict(tracks: LaneTracks, ego: EgoState | None, dt_s: float | None, params: LaneParams) -> LaneTracks:
    """The lines ``dt_s`` later, relative to the moved car, without those not seen for too long."""
    if dt_s is None:
        return tracks
    later = [evolve(line, unseen_s=line.unseen_s + dt_s) for line in moved(tracks.lines, ego, dt_s)]
    kept = tuple(line for line in later if line.unseen_s <= params.max_age_s and line.x_max_m > 0.0)
    return LaneTracks(kept, tracks.source, tracks.age_s + dt_s)


def moved(lines: tuple[Line, ...], ego: EgoState | None, dt_s: float) -> tuple[Line, ...]:
    """Lines relative to the car ``dt_s`` later; unchanged after no time."""
    if dt_s == 0.0:
        return lines
    way, turn = _way_and_turn(ego, dt_s)
    move, offset = shifted(way), np.array([-0.5 * way * turn, -turn, 0.0, 0.0])
    noise = _noise(ego, dt_s)
    return tuple(
        evolve(
            line,
            coefficients=move @ line.coefficients + offset,
            covariance=move @ line.covariance @ move.T + noise,
            x_min_m=line.x_min_m - way,
            x_max_m=line.x_max_m - way,
        )
        for line in lines
    )


def moved_points(points: F64, ego: EgoState | None, dt_s: float) -> F64:
    """The same for points (M, 2), x y."""
    way, turn = _way_and_turn(ego, dt_s)
    x = points[:, 0] - way
    return np.column_stack([x, points[:, 1] - x * turn - 0.5 * way * turn])


def _way_and_turn(ego: EgoState | None, dt_s: float) -> tuple[float, float]:
    """Metres driven and radians turned in this time; 0 where not known."""
    if ego is None:
        return 0.0, 0.0
    return ego.speed_mps * dt_s, (ego.yaw_rate_radps or 0.0) * dt_s


def update(
    tracks: LaneTracks, source: str, measured: tuple[FittedLine, ...], params: LaneParams, age_s: float = 0.0
) -> LaneTracks:
    """The lines after an image, which was taken ``age_s`` ago. A line that was not found in it fades; a new line starts
    with its measured quality."""
    pairs = _pairs(tracks.lines, measured, params.gate_m)
    lines = [_joined(line, measured[pairs[i]]) if i in pairs else _faded(line) for i, line in enumerate(tracks.lines)]
    new = [found for j, found in enumerate(measured) if j not in pairs.values()]
    lines += [LineTrack(f.coefficients, f.covariance, f.x_min_m, f.x_max_m, f.quality) for f in new]
    return LaneTracks(tuple(line for line in lines if line.quality >= _FORGOTTEN), source, age_s)


def is_settled(tracks: LaneTracks, params: LaneParams) -> bool:
    """Whether the lines of a standing car are known: further images of the same view say nothing new."""
    return any(line.seen >= _SETTLED and _quality_now(line) >= params.min_quality for line in tracks.lines)


def ego_lane(tracks: LaneTracks, pitch_rad: float, plane: F64, params: LaneParams) -> EgoLane | None:
    """The pair of lines that the car is most likely between; None before the first result of a detector.

    Each side has a trusted line or none. A pair whose width is implausible for a lane is not used: one of the lines or
    the calibration is wrong, and unless another line decides which, only the better supported line is returned.
    """
    if tracks.source is None:
        return None
    believed = [_Candidate.of(line) for line in tracks.lines if _quality_now(line) >= params.min_quality]
    left = [each for each in believed if 0.0 < each.beside_m < _FURTHEST_M]
    right = [each for each in believed if -_FURTHEST_M < each.beside_m <= 0.0]
    pairs = [(a, b) for a in [*left, None] for b in [*right, None]]
    a, b = max(pairs, key=lambda pair: _worth(pair[0], pair[1], params))
    width = _width_m(a, b) if a is not None and b is not None else None
    return EgoLane(_as_line("left", a), _as_line("right", b), tracks.source, tracks.age_s, pitch_rad, width, plane)


def expected_shape(tracks: LaneTracks) -> RoadCurve | None:
    """Heading and curvature of the best line, to search around; None if no line is certain."""
    best = max(tracks.lines, key=lambda line: line.quality, default=None)
    if best is None or best.quality < 0.5 or best.seen < 3:
        return None
    return RoadCurve(
        float(best.coefficients[1]),
        float(2.0 * best.coefficients[2]),
        heading_reach_rad=0.045,
        curvature_reach_per_m=0.003,
    )


def shifted(way_m: float) -> F64:
    """(4, 4) that takes the coefficients of y(x) to those of y(x + way)."""
    w = way_m
    return np.array(
        [[1.0, w, w * w, w**3], [0.0, 1.0, 2.0 * w, 3.0 * w * w], [0.0, 0.0, 1.0, 3.0 * w], [0.0, 0.0, 0.0, 1.0]]
    )


def _noise(ego: EgoState | None, dt_s: float) -> F64:
    """Process noise of one step, from the car's motion and the change of the road's curvature: position, heading, half
    the curvature, its change."""
    knows_turn = ego is not None and ego.yaw_rate_radps is not None
    way = (ego.speed_mps if ego is not None else _UNKNOWN_SPEED_MPS) * dt_s
    turn = (_YAW_RATE_SIGMA_RADPS if knows_turn else _UNKNOWN_YAW_RATE_RADPS) * dt_s
    place = 0.1 * dt_s + 0.5 * way * turn if ego is not None else _UNKNOWN_DRIFT_MPS * dt_s
    bend = 0.5 * _CLOTHOID_PER_M2 * way
    return np.diag(np.square([place, turn, bend, bend / 60.0]))


def _pairs(lines: tuple[LineTrack, ...], measured: tuple[FittedLine, ...], gate_m: float) -> dict[int, int]:
    """Assignment of tracks to measured lines: nearest first, one-to-one, within the gate at 5 and 15 m."""
    if not lines or not measured:
        return {}
    old = np.array([_COMPARE_AT @ line.coefficients for line in lines])
    new = np.array([_COMPARE_AT @ line.coefficients for line in measured])
    gaps = np.abs(old[:, None] - new[None]) @ np.array([0.6, 0.4])
    pairs: dict[int, int] = {}
    for i, j in np.argwhere(gaps < gate_m)[np.argsort(gaps[gaps < gate_m], kind="stable")].tolist():
        if i not in pairs and j not in pairs.values():
            pairs[i] = j
    return pairs


def _joined(line: LineTrack, found: FittedLine) -> LineTrack:
    mean, cov = _update(line.coefficients, line.covariance, found.coefficients, found.covariance)
    return LineTrack(
        mean,
        cov,
        min(line.x_min_m, found.x_min_m) if line.seen > 1 else found.x_min_m,
        max(line.x_max_m, found.x_max_m),
        line.quality + _SEEN_GAIN * (found.quality - line.quality),
        line.seen + 1,
    )


@numba.njit(cache=True, nogil=True)
def _update(mean, cov, seen, seen_cov):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Mean (4,) and covariance (4, 4), in Joseph's form, after a measurement of all four coefficients."""
    gain = np.ascontiguousarray(np.linalg.solve(cov + seen_cov, cov).T)
    keep = np.eye(4) - gain
    joseph = keep @ cov @ keep.T + gain @ seen_cov @ gain.T
    return mean + gain @ (seen - mean), (joseph + joseph.T) / 2.0


def warm_up() -> None:
    """Compile the kernel, or load it from numba's cache."""
    _update(np.zeros(4), np.eye(4), np.zeros(4), np.eye(4))


def _faded(line: LineTrack) -> LineTrack:
    return evolve(line, quality=line.quality * (1.0 - _SEEN_GAIN))


def _quality_now(line: LineTrack) -> float:
    return line.quality * math.exp(-line.unseen_s / _FADE_S)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A line that may belong to the ego lane. beside_m: lateral position at the front wheels; ahead_m: mean lateral
    position over the first 20 m; heading: its mean slope there."""

    line: LineTrack
    quality: float
    beside_m: float
    ahead_m: float
    heading: float

    @staticmethod
    def of(line: LineTrack) -> _Candidate:
        beside, *ahead = (_PLACES @ line.coefficients).tolist()
        heading = (ahead[-1] - ahead[0]) / _OVER_M
        return _Candidate(line, _quality_now(line), beside, sum(ahead) / len(ahead), heading)


def _worth(left: _Candidate | None, right: _Candidate | None, params: LaneParams) -> float:
    """Score of a pair: well supported, long known, as wide as a lane, with the car near its middle. A single line must
    not lie under the car, as shadows and tracks in snow do, because the side of the lane would be unknown."""
    both = [each for each in (left, right) if each is not None]
    worth = sum(each.quality * each.line.seen / (each.line.seen + 1.0) for each in both)
    places = sum(each.beside_m for each in both)
    if not both:
        return 0.0
    if left is None or right is None:
        return worth if _CAR_HALF_M < abs(places) < params.max_width_m - _CAR_HALF_M else -1.0
    width, unparallel = _width_m(left, right), left.heading - right.heading
    if not params.min_width_m <= width <= params.max_width_m or abs(unparallel) > _MOST_UNPARALLEL:
        return -1.0
    usual = ((width - _USUAL_WIDTH_M) / 0.5) ** 2 + (places / 2.0 / _USUALLY_OFF_MIDDLE_M) ** 2
    usual += (unparallel / _USUALLY_UNPARALLEL) ** 2
    return worth + 0.5 * math.exp(-0.5 * usual)


def _width_m(left: _Candidate, right: _Candidate) -> float:
    """Mean over the first 20 m, perpendicular to the lines."""
    return (left.ahead_m - right.ahead_m) * math.cos(math.atan((left.heading + right.heading) / 2.0))


def _as_line(side: Side, chosen: _Candidate | None) -> LaneLine | None:
    if chosen is None:
        return None
    line = chosen.line
    return LaneLine(
        side,
        line.coefficients,
        line.covariance + _NOT_CUBIC,
        max(line.x_min_m, 0.0),
        line.x_max_m,
        chosen.quality,
        line.unseen_s,
    )
