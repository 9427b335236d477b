"""The estimate of the path ahead by one source, and the two simplest sources: straight ahead, and between the lane
lines.

Every estimate is sampled at the same path lengths s = 0, 1, 2, … m, as points in the ego frame, because a function
x → y would fold up in a tight bend. Its sigma is that of the lateral position, along the normal, at each point.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from pipeline.common.geometry import F64
from pipeline.params import PathParams
from pipeline.types import EgoState
from pipeline.types.lane import EgoLane, LaneLine

PathSourceName = Literal["lane", "gnss", "yaw_rate", "straight", "edges", "traffic", "drivable_area"]
SOURCES: tuple[PathSourceName, ...] = ("lane", "gnss", "yaw_rate", "straight", "edges", "traffic", "drivable_area")
STEP_M = 1.0
"""Distance of two samples of a path, along it."""
UNKNOWN_SIGMA_M = 1e3
"""Sigma where a source gives no position."""
SHARPEST_BEGIN_PER_M2 = 0.0044
"""Maximum change of a road's curvature along it: a street corner of 15 m radius that begins over 15 m. At speed,
lateral jerk limits it further; a creeping car could turn its wheels on the spot, but the road ahead does not."""
_STRAIGHT_CURVATURE = 1e-6
"""Below this curvature, 1/m, a parabola is exact, and the formulas of an arc divide by almost nothing."""
_FASTEST_CURVATURE_PER_M = 1.0 / 500.0
"""Curvature assumed possible if the speed is not known: a road for 100 km/h has curves down to a 500 m radius."""
TIGHTEST_CURVATURE_PER_M = 0.02
"""Of a road other than at a street corner: a radius of 50 m."""
_LANE_WIDTH_SIGMA_M = 0.3
"""Uncertainty of a lane's width if only one of its lines is seen."""
_USUAL_LANE_M = 3.5
"""Width of a lane of which only one line is seen and none was measured before."""
_CAR_HALF_M, _SOON_M = 0.9, 15.0
"""Half a car's width, and the distance within which a line is crossed if the crossing is intended."""
_HEADING_AT = 5
"""Length in metres over which the lane's heading relative to the car is measured."""
_PITCH_SIGMA_RAD, _EYE_HEIGHT_M = 0.003, 1.2
"""Possible slope of the road ahead relative to the car, and the height of a camera: together they give the distance
error of a point on the road."""
_SHAPE_CURVATURE_PER_M = 0.04
"""Largest change of curvature over 20 m that ``road_shape`` can follow: 8 m aside."""
_CORNER_CURVATURE_PER_M = 0.1
"""Largest curvature of a street corner: 10 m."""
_CORNER_SHARE = 0.6
"""Standard deviation of the car's way, as a share of how far aside the tightest corner leads that it could take: it may
take it or not. In 2,240 frames of simulated streets with corners of 12 and 20 m radius, the errors of the path up to
20 m then lie within one sigma in 50 to 95 %, and within two in 85 to 99 %."""


@dataclass(frozen=True, eq=False)
class PathEstimate:
    """The path according to one source, at s = 0, 1, … m."""

    source: PathSourceName
    """Whose estimate it is."""
    center: F64
    """(K, 2) float64 ego x, y."""
    sigma_m: F64
    """(K,) float64, standard deviation of the lateral position."""
    left_m: F64 | None = None
    """(K,) float64, distance from the centre to the lane's left edge; None if the source does not see edges."""
    right_m: F64 | None = None
    """The same for the right edge."""


@lru_cache(maxsize=8)
def samples(length_m: float) -> F64:
    """(K,) path lengths of the samples of every estimate, read-only."""
    s = np.arange(0.0, length_m + STEP_M / 2, STEP_M)
    s.flags.writeable = False
    return s


def corner_m(ego: EgoState | None, params: PathParams) -> F64:
    """(K,) standard deviation of the path due to street corners that no lane line or route shows. What is beside the
    road does not tell whether the car turns at a corner, but its speed tells whether it can."""
    s = samples(params.length_m)
    if ego is None:
        return np.zeros_like(s)
    speed2 = max(ego.speed_mps, params.min_speed_mps, 0.1) ** 2
    tightest = min(params.lateral_accel_mps2 / speed2, _CORNER_CURVATURE_PER_M)
    beyond = max(tightest - _SHAPE_CURVATURE_PER_M, 0.0)
    return np.minimum(_CORNER_SHARE * 0.5 * beyond * s * s, SHARPEST_BEGIN_PER_M2 / 6.0 * s**3)


def arc(curvature: float, s: F64) -> tuple[F64, F64]:
    """(K, 2) points and (K,) headings at path lengths ``s`` of an arc from the origin along +x; curvature is positive
    to the left. At path length s the heading has turned by θ = s/r and the lateral offset is r(1 − cos θ). The arc
    continues straight after a quarter circle, so that no corridor leads behind the car."""
    theta = np.clip(curvature * s, -np.pi / 2, np.pi / 2)
    if abs(curvature) < _STRAIGHT_CURVATURE:
        return np.column_stack([s, 0.5 * curvature * s * s]), theta
    beyond = s - np.abs(theta) / abs(curvature)
    x = np.sin(theta) / curvature + beyond * np.cos(theta)
    y = (1.0 - np.cos(theta)) / curvature + beyond * np.sin(theta)
    return np.column_stack([x, y]), theta


def straight(ego: EgoState | None, params: PathParams) -> PathEstimate:
    """Straight ahead: the fallback that is always available. Its sigma covers all curvatures possible at this speed."""
    s = samples(params.length_m)
    if ego is None:
        curvature_sigma = _FASTEST_CURVATURE_PER_M
    else:
        speed2 = max(ego.speed_mps, params.min_speed_mps, 0.1) ** 2
        curvature_sigma = min(params.lateral_accel_mps2 / speed2, TIGHTEST_CURVATURE_PER_M)
    center = np.column_stack([s, np.zeros_like(s)])
    bends_by = np.minimum(0.5 * curvature_sigma * s * s, SHARPEST_BEGIN_PER_M2 / 6.0 * s**3)
    return PathEstimate("straight", center, np.hypot(params.lane_keeping_sigma_m, bends_by))


def slope_error_m(center: F64) -> F64:
    """(K,) lateral error of a path of (K, 2) points that was seen in an image: the camera's pitch relative to the road
    shifts a bend sideways."""
    way = np.gradient(center, STEP_M, axis=0)
    return np.asarray(np.abs(way[:, 1]) * _distance_error_m(center[:, 0]))


def _distance_error_m(x: F64) -> F64:
    """(K,) error of the distance of points on the road at (K,) distances, for the camera's pitch relative to the
    road."""
    error: F64 = x * x / _EYE_HEIGHT_M * _PITCH_SIGMA_RAD
    return error


def between_lines(lane: EgoLane | None, params: PathParams) -> PathEstimate | None:
    """The middle between the lane's two lines, or half a lane beside the only visible one; None without lines. The
    lines need not be parallel. Beyond the end of a line its covariance grows, and so does the sigma here."""
    if lane is None or (lane.left is None and lane.right is None):
        return None
    x, reach = _along(lane, params)
    left, right = _places(lane.left, x), _places(lane.right, x)
    half = 0.5 * (lane.width_m or _USUAL_LANE_M)
    if left is not None and right is not None:
        y, sigma = 0.5 * (left[0] + right[0]), 0.5 * np.hypot(left[1], right[1])
        half_left = half_right = np.maximum(0.5 * (left[0] - right[0]), 0.1)
    else:
        (y, sigma), side = (left, -1.0) if left is not None else (right, 1.0)  # type: ignore[misc]
        y, sigma = y + side * half, np.hypot(sigma, 0.5 * _LANE_WIDTH_SIGMA_M)
        half_left = half_right = np.full(len(x), half)
    aside, open_m = _leaving(x, y, half_left, half_right)
    return _as_estimate(x, y - aside, np.hypot(sigma, open_m), half_left, half_right, reach, params)


def _leaving(x: F64, y: F64, left: F64, right: F64) -> tuple[F64, F64]:
    """For a car that points out of its lane: its expected distance from the middle of the lane at each x, and the
    uncertainty.

    The car either stays in the lane or continues in its direction; the latter is the more likely the sooner its side
    crosses the line. The result is the mean and spread of both cases.
    """
    heading = float(y[_HEADING_AT] - y[0]) / _HEADING_AT
    to_line_m = float(left[0] + y[0] if heading < 0.0 else right[0] - y[0]) - _CAR_HALF_M
    crossing_m = max(to_line_m, 0.0) / max(abs(heading), 1e-6)
    goes = float(np.exp(-((crossing_m / _SOON_M) ** 2)))
    away_m = y[0] + heading * x
    return goes * away_m, np.sqrt(goes * (1.0 - goes)) * np.abs(away_m)


def _places(line: LaneLine | None, x: F64) -> tuple[F64, F64] | None:
    return None if line is None else line.along(x)


def _along(lane: EgoLane, params: PathParams) -> tuple[F64, float]:
    """x at which the lines are sampled, and how far paint supports either of them."""
    reach = max(line.x_max_m for line in (lane.left, lane.right) if line is not None)
    return samples(params.length_m), reach


def _as_estimate(
    x: F64, y: F64, sigma: F64, left: F64, right: F64, reach: float, params: PathParams
) -> PathEstimate | None:
    """Resamples y(x) along the path, with edges and sigma along its normal. In a bend, the camera's pitch relative to
    the road shifts the lines sideways. Beyond the paint, the sigma grows by how far a road may bend away."""
    slope = np.gradient(y, STEP_M)
    stretch = np.sqrt(1.0 + slope * slope)
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * (stretch[1:] + stretch[:-1]) * STEP_M)])
    across = 1.0 / stretch
    beyond = np.maximum(x - reach, 0.0)
    sideways = slope * _distance_error_m(x)
    sigma = across * np.sqrt(sigma**2 + sideways**2 + (0.5 * _FASTEST_CURVATURE_PER_M * beyond**2) ** 2)
    if not (np.isfinite(y).all() and np.isfinite(sigma).all()):
        return None
    s = samples(params.length_m)
    at = np.interp(s, travelled, x)
    rows = [np.interp(at, x, row) for row in (y, sigma, left * across, right * across)]
    return PathEstimate("lane", np.column_stack([at, rows[0]]), rows[1], rows[2], rows[3])
