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

from pipeline.common.made_sweep import made_sweep
from pipeline.types import F32, F64, Ground, LidarTrack, Sweep
from pipeline.types.ground_planes import height_above

NEAREST_M, FARTHEST_M = 2.5, 80.0
"""Closer points are the car's own body; farther ones are too sparse to match with a 16-channel LiDAR."""
_ABOVE_ROAD_M = 0.3
"""Kerbs and the road's unevenness are lower than this."""
_VEHICLE_M, _LONGEST_M, _WIDEST_M, _MARGIN_M = 1.2, 15.0, 3.0, 0.5
"""Clusters with a footprint between the rear of a small car and a coach may be vehicles. Points within the margin
around them are excluded as well."""
_CELL_M, _NOISE_M = 1.5, 0.05
"""Structure is evaluated in cells of this size; due to a LiDAR's noise (3 cm), a pole is at least this thick."""
_LONGEST_LEVER_M = 30.0
"""Structure farther away is sampled so sparsely that its longer lever arm brings no gain."""


def standing(sweep: Sweep, ground: Ground, tracks: tuple[LidarTrack, ...], dt_s: float) -> F32:
    """(M, 3) float32 points above the road that are in no vehicle. ground: of the previous sweep; the road changes by
    centimetres in between. tracks: of the previous sweep, ``dt_s`` ago."""
    return np.asarray(
        _standing(
            sweep.points,
            ground.planes,
            ground.edges,
            _vehicles(tracks, dt_s),
            np.float32(NEAREST_M),
            np.float32(FARTHEST_M),
            _ABOVE_ROAD_M,
        )
    )


def _vehicles(tracks: tuple[LidarTrack, ...], dt_s: float) -> F64:
    """(B, 6) ``x y half_length half_width cos sin`` of possible vehicles, predicted to now."""
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
    planes, edges, boxes = np.array([[0.0, 0.0, 1.0, 0.0]]), np.array([0.0, 1.0]), np.zeros((1, 6))
    points, _ = made_sweep()
    support(_standing(points, planes, edges, boxes, np.float32(0.0), np.float32(9.0), 0.0))


class Support(NamedTuple):
    """How well structure constrains own motion."""

    along_x: float
    """Number of cells that constrain motion along x."""
    along_y: float
    """Number of cells that constrain motion along y."""
    turning_m2: float
    """Constraint of the heading: squared lever arms of all cells, m²."""


def support(points: F32) -> Support:
    """Constraints from (M, 3) points above the road. A cell fully constrains the direction of its normal, and its
    tangential direction the more the shorter it is."""
    return Support(*_support(points, _CELL_M, _NOISE_M**2, FARTHEST_M, _LONGEST_LEVER_M))


@numba.njit(cache=True, nogil=True)
def _standing(points, planes, edges, boxes, nearest_m, farthest_m, above_m):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(M, 3) points between two ranges, higher above the ground than ``above_m`` and in none of the boxes. Without
    ground, where heights are NaN, none."""
    found = np.empty((len(points), 3), np.float32)
    count = 0
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        if not height_above(planes, edges, x, y, z) > above_m:
            continue
        range_m = np.hypot(x, y)
        if range_m > nearest_m and range_m < farthest_m and not _is_inside(x, y, boxes):
            found[count, 0], found[count, 1], found[count, 2] = x, y, z
            count += 1
    return found[:count].copy()


@numba.njit(cache=True, nogil=True)
def _is_inside(x, y, boxes):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Whether a point lies in one of the boxes, seen from above."""
    for b in range(len(boxes)):
        dx, dy = x - boxes[b, 0], y - boxes[b, 1]
        along = dx * boxes[b, 4] + dy * boxes[b, 5]
        across = dy * boxes[b, 4] - dx * boxes[b, 5]
        if abs(along) < boxes[b, 2] and abs(across) < boxes[b, 3]:
            return True
    return False


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
        # unit vector along the cell's structure: cos² and sin² of its angle
        c2 = 0.5 + 0.25 * (xx - yy) / half if half > 1e-9 else 0.5
        lengthwise = 2.0 * thin_var / (long_var + thin_var)
        along_x += (1.0 - c2) + c2 * lengthwise
        along_y += c2 + (1.0 - c2) * lengthwise
        # the same as lever arms about the origin: for the direction along the cell, and for its normal
        cs = 0.5 * xy / half if half > 1e-9 else 0.0
        along2 = c2 * mx * mx + 2.0 * cs * mx * my + (1.0 - c2) * my * my
        square = mx * mx + my * my
        turning += (along2 + lengthwise * (square - along2)) * min(1.0, lever_m * lever_m / max(square, 1e-9))
    return along_x, along_y, turning
