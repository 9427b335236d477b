"""Upright cuboids around clusters (paper, Point Cloud Segmentation: "cuboid of the bounding box").

``l_shape`` turns the box so that its sides lie closest to the points: search over the yaw with the closeness criterion
of Zhang, Xu, Dong, Dolan, *Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners* (IV 2017,
Algorithm 4). Length and width are what was seen, not a guess at the whole vehicle: seen from behind, a car is a wall
1.6 m wide and a few centimetres long.
"""

from __future__ import annotations

import numba
import numpy as np

from pipeline.geometry import Cuboid
from pipeline.lidar.ground import Ground
from pipeline.params import BoxParams
from pipeline.types import F32, F64, I32, Obstacle

NEAREST_M = 0.05
"""Distances to a side below this count as this (Zhang's d0), or one point on a side would outweigh all others."""
SEARCH_POINTS = 200
"""The turn of a larger cluster is judged by this many of its points, spread over it."""
WIDEST_REAR_M = 2.7
"""No vehicle is wider: a longer side is a length."""
MIN_SIDE_M = 0.05
"""Sides are never shown thinner than the range noise."""
MIN_AREA_M2 = 0.1
"""The footprint that densities refer to is never smaller: a rear seen by a single ring has none."""


def fit_obstacles(points: F32, labels: I32, ground: Ground, params: BoxParams) -> tuple[Obstacle, ...]:
    """One obstacle a cluster, in the order of the labels 0, 1, ….

    points: (N, 4) float32 ``x y z intensity``, ego frame. labels: (N,) int32 as ``cluster`` gives them.

    The yaw lies in (−π/2, π/2]. A box's turn is known only modulo 90°: the length axis is the side that is too long to
    be a vehicle's rear, else the one closer to ego x, since vehicles ahead mostly drive our way. The cuboid stands on
    the ground when its lowest point is within ``ground_gap_m`` of it: the next ring below may have passed under.
    ``closest_point`` is the cluster's point of least horizontal range from the ego origin.
    """
    count = int(labels.max(initial=-1)) + 1
    if count == 0:
        return ()
    boxes, sizes = _boxes(points, labels, count, turns(params))
    floor = ground.height(boxes[:, :2])
    bottom = np.where(np.abs(boxes[:, 5] - floor) <= params.ground_gap_m, np.minimum(floor, boxes[:, 5]), boxes[:, 5])
    area = np.maximum(boxes[:, 2] * boxes[:, 3], MIN_AREA_M2)
    sides = np.maximum(np.column_stack([boxes[:, 2:4], boxes[:, 6] - bottom]), MIN_SIDE_M)
    center_z = (bottom + boxes[:, 6]) / 2
    rows = zip(boxes.tolist(), sides.tolist(), center_z.tolist(), sizes.tolist(), (sizes / area).tolist(), strict=True)
    return tuple(
        Obstacle(
            cluster=i,
            cuboid=Cuboid((row[0], row[1], z), (side[0], side[1], side[2]), row[4]),
            closest_point=(row[7], row[8], row[9]),
            points=size,
            density=density,
            spread=(row[10], row[11], row[12]),
        )
        for i, (row, side, z, size, density) in enumerate(rows)
    )


def turns(params: BoxParams) -> F64:
    """(K,) the turns in [0, π/2) that a box may have."""
    step_rad = np.radians(params.yaw_step_deg)
    return np.arange(np.ceil(np.pi / 2 / step_rad - 1e-9)) * step_rad if params.method == "l_shape" else np.zeros(1)


@numba.njit(cache=True, nogil=True)
def _boxes(points: F32, labels: I32, count: int, turns: F64) -> tuple[F64, I32]:
    """turns: (K,) as ``turns`` gives them. boxes (count, 13) float64: center x, y, length, width, yaw, lowest z,
    highest z, closest point x, y, z, spread x, y, z. sizes (count,) int32."""
    size = np.zeros(count, dtype=np.int32)
    for i in range(len(labels)):
        if labels[i] >= 0:
            size[labels[i]] += 1
    start = np.zeros(count + 1, dtype=np.int32)
    for c in range(count):
        start[c + 1] = start[c] + size[c]
    place = start[:-1].copy()
    xyz = np.empty((3, start[count]), dtype=np.float64)
    for i in range(len(labels)):
        if labels[i] >= 0:
            for a in range(3):
                xyz[a, place[labels[i]]] = points[i, a]
            place[labels[i]] += 1
    boxes = np.empty((count, 13))
    cos, sin = np.cos(turns).astype(np.float32), np.sin(turns).astype(np.float32)
    for c in range(count):
        x, y, z = xyz[0, start[c] : start[c + 1]], xyz[1, start[c] : start[c + 1]], xyz[2, start[c] : start[c + 1]]
        _rectangle(x, y, turns[_best_turn(x, y, cos, sin)], boxes[c])
        nearest = np.argmin(x * x + y * y)
        boxes[c, 5], boxes[c, 6] = z.min(), z.max()
        boxes[c, 7], boxes[c, 8], boxes[c, 9] = x[nearest], y[nearest], z[nearest]
        boxes[c, 10], boxes[c, 11], boxes[c, 12] = x.std(), y.std(), z.std()
    return boxes, size


@numba.njit(cache=True, nogil=True)
def _best_turn(x: F64, y: F64, cos: F32, sin: F32) -> int:
    """Place of the turn of the best closeness, the first of several."""
    if len(cos) < 2 or len(x) < 3:
        return 0
    stride = (len(x) + SEARCH_POINTS - 1) // SEARCH_POINTS
    near_x, near_y = (x[::stride] - x[0]).astype(np.float32), (y[::stride] - y[0]).astype(np.float32)
    best, best_score = 0, -1.0
    for k in range(len(cos)):
        score = _closeness(near_x, near_y, cos[k], sin[k])
        if score > best_score:
            best, best_score = k, score
    return best


# Neither loop below stores into an array or can raise: then the compiler vectorises them.


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz", "nnan"})
def _closeness(x: F32, y: F32, cos: float, sin: float) -> float:
    """Σ 1/max(d, d0), d the distance of a point to the nearer of two sides of the box with this turn: of each pair of
    parallel sides the one that the points gather at (Zhang 2017, Algorithm 4)."""
    u_side, v_side = _side(x, y, cos, sin), _side(y, x, cos, -sin)
    score, nearest = np.float32(0.0), np.float32(NEAREST_M)
    for i in range(len(x)):
        u, v = x[i] * cos + y[i] * sin - u_side, y[i] * cos - x[i] * sin - v_side
        score += np.float32(1.0) / max(min(abs(u), abs(v)), nearest)
    return float(score)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz", "nnan"})
def _side(x: F32, y: F32, cos: float, sin: float) -> float:
    """The end of x·cos + y·sin that the points gather at."""
    low = high = x[0] * cos + y[0] * sin
    total = np.float32(0.0)
    for i in range(len(x)):
        u = x[i] * cos + y[i] * sin
        low, high = min(low, u), max(high, u)
        total += u
    return high if 2 * total > len(x) * (low + high) else low


@numba.njit(cache=True, nogil=True)
def _rectangle(x: F64, y: F64, turn: float, out: F64) -> None:
    """center x, y, length, width, yaw of the rectangle with this turn around the points, into ``out``."""
    cos, sin = np.cos(turn), np.sin(turn)
    u, v = x * cos + y * sin, y * cos - x * sin
    u_low, u_high, v_low, v_high = u.min(), u.max(), v.min(), v.max()
    u_mid, v_mid = (u_low + u_high) / 2, (v_low + v_high) / 2
    out[0], out[1] = u_mid * cos - v_mid * sin, u_mid * sin + v_mid * cos
    along_u, along_v = u_high - u_low, v_high - v_low
    u_is_length = turn <= np.pi / 4 + 1e-9
    if max(along_u, along_v) > WIDEST_REAR_M:
        u_is_length = along_u >= along_v
    out[2], out[3] = (along_u, along_v) if u_is_length else (along_v, along_u)
    if u_is_length:
        out[4] = turn
    else:
        out[4] = turn - np.pi / 2 if turn > 1e-12 else np.pi / 2
