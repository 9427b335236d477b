"""The ego corridor: where the car is going, as a centre line with a left and a right edge (paper, section CIPV).

The paper takes lane centres on straights and a GPS path in curves. Where neither is there, the car's own yaw rate bends
the corridor along its true arc: at path length s the heading has turned by θ = s/r and the car has moved aside by
r(1 − cos θ).
"""

from __future__ import annotations

import numba
import numpy as np

from pipeline.geometry import F64
from pipeline.params import PathParams
from pipeline.types import EgoState, Path

STEP_M = 1.0
_STRAIGHT_CURVATURE = 1e-6
_LOOK_AHEAD_M = (10.0, 30.0, 60.0)

STRAIGHT_CURVATURE_SIGMA = 1.0 / 500.0
"""Curvature a straight guess leaves open: a 500 m radius is the tightest curve of a road driven at 100 km/h."""
YAW_RATE_SIGMA_RADPS = 0.01
"""Noise of an automotive yaw-rate sensor together with the driver's small corrections."""


def corridor(ego: EgoState | None, params: PathParams) -> Path:
    """The path in ego coordinates. Without ego speed or yaw rate, or too slow for the yaw rate to mean a curve, it is
    straight, and its uncertainty says so."""
    bends = (
        params.use_yaw_rate
        and ego is not None
        and ego.yaw_rate_radps is not None
        and ego.speed_mps >= params.min_speed_mps
    )
    if bends and ego is not None and ego.yaw_rate_radps is not None:
        curvature = ego.yaw_rate_radps / ego.speed_mps
        curvature_sigma = YAW_RATE_SIGMA_RADPS / ego.speed_mps
    else:
        curvature, curvature_sigma = 0.0, STRAIGHT_CURVATURE_SIGMA
    center, heading = arc(curvature, np.arange(0.0, params.length_m + STEP_M / 2, STEP_M))
    normal = np.column_stack([-np.sin(heading), np.cos(heading)])
    source = "yaw_rate" if bends else "straight"
    return Path(
        source=source,  # type: ignore[arg-type]
        center=center,
        left=center + params.half_width_m * normal,
        right=center - params.half_width_m * normal,
        half_width_m=params.half_width_m,
        sigma_m={f"{s:.0f}": 0.5 * curvature_sigma * s * s for s in _LOOK_AHEAD_M},
        weights={source: 1.0},
    )


def arc(curvature: float, s: F64) -> tuple[F64, F64]:
    """(K, 2) points and (K,) headings at path lengths ``s`` of an arc from the origin along +x; curvature is positive
    to the left. It stops turning at a quarter circle: no corridor leads behind the car."""
    theta = np.clip(curvature * s, -np.pi / 2, np.pi / 2)
    if abs(curvature) < _STRAIGHT_CURVATURE:
        return np.column_stack([s, 0.5 * curvature * s * s]), theta
    beyond = s - np.abs(theta) / abs(curvature)
    x = np.sin(theta) / curvature + beyond * np.cos(theta)
    y = (1.0 - np.cos(theta)) / curvature + beyond * np.sin(theta)
    return np.column_stack([x, y]), theta


def offset(path: Path, points: F64) -> F64:
    """(N,) signed distance of (N, 2) ego points from the path's centre line, positive to the left of it."""
    return nearest_on_path(path, points)[0]


def nearest_on_path(path: Path, points: F64) -> tuple[F64, F64]:
    """Signed offset (N,) and path length (N,) of each point's foot on the centre line. A point before the first or
    beyond the last piece is measured against that piece's extension."""
    return _nearest(path.center, np.asarray(points, dtype=np.float64))


@numba.njit(cache=True, nogil=True)
def _nearest(center, points):  # type: ignore[no-untyped-def]  # pragma: no cover
    """For each point, the foot on each piece of the line; the nearest foot wins, the first of equals."""
    offset, reached = np.empty(len(points)), np.empty(len(points))
    last = len(center) - 2
    for n in range(len(points)):
        best2, travelled = np.inf, 0.0
        for k in range(last + 1):
            dx, dy = center[k + 1, 0] - center[k, 0], center[k + 1, 1] - center[k, 1]
            length = np.sqrt(dx * dx + dy * dy)
            dx, dy = dx / length, dy / length
            rx, ry = points[n, 0] - center[k, 0], points[n, 1] - center[k, 1]
            t = rx * dx + ry * dy
            if t < 0.0 and k > 0:
                t = 0.0
            if t > length and k < last:
                t = length
            ex, ey = rx - t * dx, ry - t * dy
            distance2 = ex * ex + ey * ey
            if distance2 < best2:
                best2 = distance2
                side = 1.0 if dx * ry - dy * rx >= 0.0 else -1.0
                offset[n], reached[n] = side * np.sqrt(distance2), travelled + t
            travelled += length
    return offset, reached
