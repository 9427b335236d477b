"""Upright cuboids around clusters (paper, Point Cloud Segmentation: "cuboid of the bounding box").

``l_shape`` turns the box so that its sides lie closest to the points: search over the yaw with the closeness criterion
of Zhang, Xu, Dong, Dolan, *Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners* (IV 2017,
Algorithm 4). Length and width are what was seen, not a guess at the whole vehicle: seen from behind, a car is a wall
1.6 m wide and a few centimetres long.
"""

from __future__ import annotations

import numba
import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.lidar.ground import Ground
from pipeline.params import BoxParams
from pipeline.types import F32, F64, I32, Obstacle

NEAREST_M = 0.05
"""Lower bound of distances to a side (Zhang's d0); otherwise one point on a side would outweigh all others."""
SEARCH_POINTS = 200
"""For larger clusters, the orientation is determined from this many points, evenly sampled."""
WIDEST_REAR_M = 2.7
"""No vehicle is wider, so a longer side is a length."""
MIN_SIDE_M = 0.05
"""Minimum displayed side length, about the range noise."""
MIN_AREA_M2 = 0.1
"""Lower bound of the footprint used for densities: a rear seen by a single ring has no area."""


def fit_obstacles(points: F32, labels: I32, ground: Ground, params: BoxParams) -> tuple[Obstacle, ...]:
    """One obstacle per cluster, in the order of the labels 0, 1, ….

    points: (N, 4) float32 ``x y z intensity``, ego frame. labels: (N,) int32 as returned by ``cluster``.

    The yaw lies in (−π/2, π/2]. A box's orientation is known only modulo 90°: the length axis is the side that is too
    long to be a vehicle's rear, else the one closer to ego x, since most vehicles ahead drive in our direction. The
    cuboid is extended down to the ground if its lowest point is within ``ground_gap_m`` of it, because the next ring
    below may have passed under it. ``closest_point`` is the cluster's point with the smallest horizontal range from the
    ego origin.
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
    """(K,) the candidate orientations of a box, in [0, π/2)."""
    step_rad = np.radians(params.yaw_step_deg)
    return np.arange(np.ceil(np.pi / 2 / step_rad - 1e-9)) * step_rad if params.method == "l_shape" else np.zeros(1)


@numba.njit(cache=True, nogil=True)
def _boxes(points: F32, labels: I32, count: int, turns: F64) -> tuple[F64, I32]:
    """turns: (K,) as returned by ``turns``. boxes (count, 13) float64: center x, y, length, width, yaw, lowest z,
    highest z, closest point x, y, z, spread x, y, z. sizes (count,) int32."""
    start = np.zeros(count + 1, dtype=np.int32)
    for i in range(len(labels)):
        start[labels[i] + 1] += 1  # points without a cluster, −1, are counted at 0 and subtracted again
    start[0] = 0
    size = start[1:].copy()
    for c in range(count):
        start[c + 1] += start[c]
    place = start[:-1].copy()
    x, y, z = np.empty(start[count]), np.empty(start[count]), np.empty(start[count])
    for i in range(len(labels)):
        if labels[i] >= 0:
            at = place[labels[i]]
            x[at], y[at], z[at] = points[i, 0], points[i, 1], points[i, 2]
            place[labels[i]] = at + 1
    boxes = np.empty((count, 13))
    cos, sin = np.cos(turns).astype(np.float32), np.sin(turns).astype(np.float32)
    for c in range(count):
        a, b = start[c], start[c + 1]
        turn = turns[_best_turn(x[a:b], y[a:b], cos, sin)]
        _describe(x[a:b], y[a:b], z[a:b], turn, boxes[c])
    return boxes, size


@numba.njit(cache=True, nogil=True)
def _best_turn(x: F64, y: F64, cos: F32, sin: F32) -> int:
    """Index of the orientation with the best closeness, the first one if several are equal."""
    if len(cos) < 2 or len(x) < 3:
        return 0
    stride = (len(x) + SEARCH_POINTS - 1) // SEARCH_POINTS
    near_x, near_y = (x[::stride] - x[0]).astype(np.float32), (y[::stride] - y[0]).astype(np.float32)
    u_side, v_side, closeness = np.empty_like(cos), np.empty_like(cos), np.empty_like(cos)
    _sides(near_x, near_y, cos, sin, u_side, v_side)
    _closeness(near_x, near_y, cos, sin, u_side, v_side, closeness)
    return int(np.argmax(closeness))


# Nothing in the two loops over points below can raise or is stored, so that the compiler can optimise them fully.


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz", "nnan"})
def _sides(x: F32, y: F32, cos: F32, sin: F32, u_side: F32, v_side: F32) -> None:
    """For each orientation, the end of x·cos + y·sin, and of y·cos − x·sin, where the points concentrate."""
    sum_x = sum_y = np.float32(0.0)
    for i in range(len(x)):
        sum_x += x[i]
        sum_y += y[i]
    for k in range(len(cos)):
        u_low = u_high = x[0] * cos[k] + y[0] * sin[k]
        v_low = v_high = y[0] * cos[k] - x[0] * sin[k]
        for i in range(len(x)):
            u, v = x[i] * cos[k] + y[i] * sin[k], y[i] * cos[k] - x[i] * sin[k]
            u_low, u_high = min(u_low, u), max(u_high, u)
            v_low, v_high = min(v_low, v), max(v_high, v)
        u_sum, v_sum = sum_x * cos[k] + sum_y * sin[k], sum_y * cos[k] - sum_x * sin[k]
        u_side[k] = u_high if 2 * u_sum > len(x) * (u_low + u_high) else u_low
        v_side[k] = v_high if 2 * v_sum > len(x) * (v_low + v_high) else v_low


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz", "nnan"})
def _closeness(x: F32, y: F32, cos: F32, sin: F32, u_side: F32, v_side: F32, closeness: F32) -> None:
    """For each orientation Σ 1/max(d, d0), where d is a point's distance to the nearer of two sides of the box: of each
    pair of parallel sides, the one where the points concentrate (Zhang 2017, Algorithm 4)."""
    nearest = np.float32(NEAREST_M)
    for k in range(len(cos)):
        score = np.float32(0.0)
        for i in range(len(x)):
            u, v = x[i] * cos[k] + y[i] * sin[k] - u_side[k], y[i] * cos[k] - x[i] * sin[k] - v_side[k]
            score += np.float32(1.0) / max(min(abs(u), abs(v)), nearest)
        closeness[k] = score


@numba.njit(cache=True, nogil=True)
def _describe(x: F64, y: F64, z: F64, turn: float, out: F64) -> None:
    """One row of ``_boxes`` for the rectangle with this orientation around the points, computed in two passes."""
    cos, sin = np.cos(turn), np.sin(turn)
    u_low = v_low = z_low = least = np.inf
    u_high = v_high = z_high = -np.inf
    sum_x = sum_y = sum_z = 0.0
    nearest = 0
    for i in range(len(x)):
        u, v = x[i] * cos + y[i] * sin, y[i] * cos - x[i] * sin
        u_low, u_high = min(u_low, u), max(u_high, u)
        v_low, v_high = min(v_low, v), max(v_high, v)
        z_low, z_high = min(z_low, z[i]), max(z_high, z[i])
        range2 = x[i] * x[i] + y[i] * y[i]
        if range2 < least:
            least, nearest = range2, i
        sum_x += x[i]
        sum_y += y[i]
        sum_z += z[i]
    _rectangle(u_low, u_high, v_low, v_high, turn, out)
    out[5], out[6] = z_low, z_high
    out[7], out[8], out[9] = x[nearest], y[nearest], z[nearest]
    mean_x, mean_y, mean_z = sum_x / len(x), sum_y / len(x), sum_z / len(x)
    var_x = var_y = var_z = 0.0
    for i in range(len(x)):
        var_x += (x[i] - mean_x) ** 2
        var_y += (y[i] - mean_y) ** 2
        var_z += (z[i] - mean_z) ** 2
    out[10], out[11], out[12] = np.sqrt(var_x / len(x)), np.sqrt(var_y / len(x)), np.sqrt(var_z / len(x))


@numba.njit(cache=True, nogil=True)
def _rectangle(u_low: float, u_high: float, v_low: float, v_high: float, turn: float, out: F64) -> None:
    """Writes center x, y, length, width, yaw of a rectangle with this orientation into ``out``."""
    cos, sin = np.cos(turn), np.sin(turn)
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
