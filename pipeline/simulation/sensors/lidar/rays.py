"""The VLP-16's firing pattern, and casting its rays into a scene of moving boxes.

16 lasers 2° apart fire one after another, 2.304 µs each; a round of them starts every 55.296 µs while the head turns
clockwise at 600 rpm (Velodyne manual 63-9243, section 9.3 and table 9-1). The front 180° are kept. The frame's tick is
when the head looks straight ahead, so what stands to the left was measured up to 25 ms before it and what stands to the
right up to 25 ms after.
"""

from __future__ import annotations

import numba
import numpy as np

from pipeline.types import F64, I64

CHANNELS = 16
ELEVATIONS_DEG = np.arange(-15.0, 16.0, 2.0)
_FIRING_S, _LASER_S, _ROTATION_S = 55.296e-6, 2.304e-6, 0.1
_FIRING_ORDER = np.array([2 * ring if ring < 8 else 2 * ring - 15 for ring in range(CHANNELS)])
"""Laser number of each ring: −15° fires first, then +1°, −13°, …"""
COLUMNS = round(_ROTATION_S / 2 / _FIRING_S)
COLUMNS_PER_RAD = (COLUMNS - 1) / np.pi

_BEHIND_M = 3.0  # objects farther behind cannot get ahead within a sweep
BOX_FIELDS = 13
"""x y z of the centre, half length, width and height, cos and sin of the yaw, material, velocity x and y, yaw rate,
factor on the material's usual range."""


def firing_times_s() -> F64:
    """(COLUMNS, 16) seconds after the tick."""
    fired = np.arange(COLUMNS)[:, None] * _FIRING_S + _FIRING_ORDER[None, :] * _LASER_S
    return np.asarray(fired - _ROTATION_S / 4, dtype=np.float64)


def directions() -> F64:
    """(COLUMNS, 16, 3) unit vectors in the sensor's axes, from +90° (left) clockwise to −90°, the lowest ring first."""
    azimuth = -firing_times_s() * 2.0 * np.pi / _ROTATION_S
    elevation = np.radians(ELEVATIONS_DEG)[None, :]
    x, y = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth)
    return np.stack([x, y, np.broadcast_to(np.sin(elevation), x.shape)], axis=2)


@numba.njit(cache=True, nogil=True)
def cast(rays: F64, times_s: F64, boxes: F64, ground: F64, spare: int) -> tuple[F64, I64, F64]:
    """The first hit of each ray of a sensor at the origin, every ray at its own time.

    rays: (COLUMNS, 16, 3). times_s: (COLUMNS,) relative to the time of the boxes. boxes: (B, 13). ground: z = ground[0]
    + ground[1]·x + ground[2]·y + ground[3]·x²/2. spare: maximum number of columns by which a mount may rotate a ray
    relative to its column. Returns (COLUMNS, 16) range (infinity: nothing), index of the box (−1: the ground) and
    cosine of the angle of incidence.
    """
    columns, channels = rays.shape[0], rays.shape[1]
    range_m = np.full((columns, channels), np.inf)
    met = np.full((columns, channels), -1, dtype=np.int64)
    cosine = np.zeros((columns, channels))
    steep = 1.0 / np.sqrt(1.0 + ground[1] ** 2 + ground[2] ** 2)
    for i in range(columns):
        for j in range(channels):
            falls = ground[1] * rays[i, j, 0] + ground[2] * rays[i, j, 1] - rays[i, j, 2]
            bends = falls * falls - 2.0 * ground[3] * rays[i, j, 0] ** 2 * ground[0]
            if bends >= 0.0 and falls + np.sqrt(bends) > 0.0:  # else it passes over the crest, or looks up
                range_m[i, j] = -2.0 * ground[0] / (falls + np.sqrt(bends))
                cosine[i, j] = np.sqrt(bends) * steep
    for b in range(boxes.shape[0]):
        first, last = _columns_of(boxes[b], columns, spare)
        z, half_l, half_w, half_h = boxes[b, 2], boxes[b, 3], boxes[b, 4], boxes[b, 5]
        for i in range(first, last):
            x = boxes[b, 0] + boxes[b, 9] * times_s[i]
            y = boxes[b, 1] + boxes[b, 10] * times_s[i]
            turned = boxes[b, 11] * times_s[i]
            c, s = boxes[b, 6] - boxes[b, 7] * turned, boxes[b, 7] + boxes[b, 6] * turned
            ox, oy = -x * c - y * s, x * s - y * c  # the sensor's position in the box's own axes
            for j in range(channels):
                dx = rays[i, j, 0] * c + rays[i, j, 1] * s
                dy = rays[i, j, 1] * c - rays[i, j, 0] * s
                dz = rays[i, j, 2]
                by_length, leave = _slab(ox, dx, half_l, 0.0, range_m[i, j])
                by_width, leave = _slab(oy, dy, half_w, by_length, leave)
                enter, leave = _slab(-z, dz, half_h, by_width, leave)
                if 0.0 < enter < leave:
                    range_m[i, j] = enter
                    met[i, j] = b
                    across = dz if enter > by_width else dy if by_width > by_length else dx
                    cosine[i, j] = min(abs(across), 1.0)
    return range_m, met, cosine


@numba.njit(cache=True, nogil=True)
def _columns_of(box: F64, columns: int, spare: int) -> tuple[int, int]:
    """The columns that can hit a box: all of them, unless it is completely ahead, on one side or behind, so that the
    bearings of its corners bound it."""
    x, y, half_l, half_w, c, s = box[0], box[1], box[3], box[4], box[6], box[7]
    deep, wide = abs(half_l * c) + abs(half_w * s), abs(half_l * s) + abs(half_w * c)
    if x + deep < -_BEHIND_M - abs(y):
        return 0, 0
    if x - deep <= 0.5 and abs(y) - wide <= 0.5:
        return 0, columns
    low, high = np.inf, -np.inf
    for k in range(4):
        dx, dy = half_l * (1 - 2 * (k // 2)), half_w * (1 - 2 * (k % 2))
        azimuth = np.arctan2(y + dx * s + dy * c, x + dx * c - dy * s)
        low, high = min(low, azimuth), max(high, azimuth)
    nearest_m = max(np.hypot(x, y) - np.hypot(half_l, half_w), 0.5)
    quarter_s = 0.025
    moved = (np.hypot(box[9], box[10]) + abs(box[11]) * (half_l + half_w)) * quarter_s / nearest_m
    per_rad = (columns - 1) / np.pi
    first = int((np.pi / 2 - high - moved) * per_rad) - 2 - spare
    last = int((np.pi / 2 - low + moved) * per_rad) + 3 + spare
    return max(0, first), min(columns, last)


@numba.njit(cache=True, nogil=True)
def _slab(start: float, direction: float, half: float, enter: float, leave: float) -> tuple[float, float]:
    """Clip the interval enter…leave of a ray to the part between two planes at ±half."""
    if abs(direction) < 1e-12:
        return (enter, leave) if abs(start) <= half else (1.0, 0.0)
    near, far = (-half - start) / direction, (half - start) / direction
    if near > far:
        near, far = far, near
    return max(enter, near), min(leave, far)
