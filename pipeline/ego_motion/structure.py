"""Selects the points of a sweep that can support odometry: upright objects other than vehicles, and how well they
constrain ego motion.

The road looks the same a metre further on, and its rings travel with the sensor, so it biases the result towards
standstill. Vehicles may move: on an empty motorway the lead is the only upright object, and suggests that the car
stands. The remaining points (poles, trees, walls, houses) count by how well they constrain motion along x and y: a wall
beside the road constrains only y, a pole constrains both. In a tunnel, nothing constrains x."""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numba
import numpy as np

from pipeline.types import F32, F64, Ground, LidarTrack, Sweep

NEAREST_M, FARTHEST_M = 2.5, 80.0
"""Nearer points are the car's own body; farther ones of a 16-channel LiDAR are too few to be matched."""
_ABOVE_ROAD_M = 0.3
"""Kerbs and the road's own unevenness stay below this."""
_VEHICLE_M, _LONGEST_M, _WIDEST_M, _MARGIN_M = 1.2, 15.0, 3.0, 0.5
"""Clusters with a footprint from the rear of a small car up to that of a coach may be vehicles. Points so far around
them go with them."""
_CELL_M, _NOISE_M = 1.5, 0.05
"""Structure is judged in cells of this size; a LiDAR's noise (3 cm) makes a pole no narrower than that."""
_LONGEST_LEVER_M = 30.0
"""Farther structure is scanned so sparsely that its longer lever gains nothing."""


def standing(sweep: Sweep, ground: Ground, tracks: tuple[LidarTrack, ...], dt_s: float) -> F32:
    """(M, 3) float32 points that stand on the road and lie in no vehicle. ground: of the sweep before, which a car
    leaves by centimetres. tracks: of the sweep before, ``dt_s`` ago."""
    points = sweep.points
    range_m = np.hypot(points[:, 0], points[:, 1])
    keep = (range_m > NEAREST_M) & (range_m < FARTHEST_M)
    keep &= ground.above(points) > _ABOVE_ROAD_M  # False without ground, whose height is not a number
    points = np.ascontiguousarray(points[keep, :3])
    boxes = _vehicles(tracks, dt_s)
    return points[~_inside(points, boxes)] if len(boxes) else points


def _vehicles(tracks: tuple[LidarTrack, ...], dt_s: float) -> F64:
    """(B, 6) ``x y half_length half_width cos sin`` of what may be a vehicle, where it should be now."""
    rows = []
    for track in tracks:
        cuboid = track.obstacle.cuboid
        length, width = cuboid.size[0], cuboid.size[1]
        if not (_VEHICLE_M < max(length, width) < _LONGEST_M and min(length, width) < _WIDEST_M):
            continue
        vx, vy = track.velocity_mps or (0.0, 0.0)
        x, y = cuboid.center[0] + vx * dt_s, cuboid.center[1] + vy * dt_s
        half = (0.5 * length + _MARGIN_M, 0.5 * width + _MARGIN_M)
        rows.append((x, y, *half, cos(cuboid.yaw_rad), sin(cuboid.yaw_rad)))
    return np.array(rows, dtype=np.float64).reshape(-1, 6)


def warm_up() -> None:
    """Compile every kernel, or load it from numba's cache."""
    points = np.zeros((2, 3), np.float32)
    _inside(points, np.zeros((1, 6)))
    support(points)


class Support(NamedTuple):
    """How well structure fixes own motion."""

    along_x: float
    """Cells that fix motion along x."""
    along_y: float
    """Cells that fix motion along y."""
    turning_m2: float
    """What fixes the heading: squared lever arms of all cells, m²."""


def support(points: F32) -> Support:
    """What (M, 3) points that stand on the road fix. A cell of them fixes its own normal fully, and the direction along
    it by how little it extends that way."""
    return Support(*_support(points, _CELL_M, _NOISE_M**2, FARTHEST_M, _LONGEST_LEVER_M))


@numba.njit(cache=True, nogil=True)
def _inside(points, boxes):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(N,) bool, which points lie in one of the boxes, seen from above."""
    inside = np.zeros(len(points), np.bool_)
    for n in range(len(points)):
        for b in range(len(boxes)):
            dx, dy = points[n, 0] - boxes[b, 0], points[n, 1] - boxes[b, 1]
            along = dx * boxes[b, 4] + dy * boxes[b, 5]
            across = dy * boxes[b, 4] - dx * boxes[b, 5]
            if abs(along) < boxes[b, 2] and abs(across) < boxes[b, 3]:
                inside[n] = True
                break
    return inside


@numba.njit(cache=True, nogil=True)
def _support(points, cell_m, noise_var, reach_m, lever_m):  # type: ignore[no-untyped-def]  # pragma: no cover
    side = int(2.0 * reach_m / cell_m) + 1
    sums = np.zeros((side * side, 6))
    for n in range(len(points)):
        x, y = np.float64(points[n, 0]), np.float64(points[n, 1])
        i, j = int((x + reach_m) / cell_m), int((y + reach_m) / cell_m)
        if 0 <= i < side and 0 <= j < side:
            cell = sums[i * side + j]
            cell[0] += 1.0
            cell[1] += x
            cell[2] += y
            cell[3] += x * x
            cell[4] += y * y
            cell[5] += x * y
    along_x, along_y, turning = 0.0, 0.0, 0.0
    for c in range(len(sums)):
        count = sums[c, 0]
        if count < 2.0:
            continue
        mx, my = sums[c, 1] / count, sums[c, 2] / count
        xx, yy, xy = sums[c, 3] / count - mx * mx, sums[c, 4] / count - my * my, sums[c, 5] / count - mx * my
        middle, half = 0.5 * (xx + yy), np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
        long_var, thin_var = middle + half + noise_var, max(middle - half, 0.0) + noise_var
        # unit vector along the cell's structure: cos² and sin² of its direction
        c2 = 0.5 + 0.25 * (xx - yy) / half if half > 1e-9 else 0.5
        lengthwise = 2.0 * thin_var / (long_var + thin_var)
        along_x += (1.0 - c2) + c2 * lengthwise
        along_y += c2 + (1.0 - c2) * lengthwise
        # the same as levers about the origin: of the direction along the cell, and of its normal
        cs = 0.5 * xy / half if half > 1e-9 else 0.0
        along2 = c2 * mx * mx + 2.0 * cs * mx * my + (1.0 - c2) * my * my
        square = mx * mx + my * my
        turning += (along2 + lengthwise * (square - along2)) * min(1.0, lever_m * lever_m / max(square, 1e-9))
    return along_x, along_y, turning
