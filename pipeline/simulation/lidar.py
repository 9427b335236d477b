"""A VLP-16 by ray casting: 16 elevations 2° apart, one firing every 55.296 µs, the front 180° of a rotation at 10 Hz.

Rays end at upright boxes or on the road. A car is two boxes, its body and its narrower cabin, most of it glass.
Whether a return is strong enough to be counted falls off with range, by material; the fall-off for vehicles is set
to what real VLP-16 sweeps show (five points or more on the car ahead: 90 % at 20–30 m, 46 % at 30–40 m, 17 % at
40–50 m, hardly any beyond). Rays of one sweep are cast at one moment: there is no distortion by motion.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from pipeline.simulation.roadside import Roadside, Thing
from pipeline.simulation.world import LIDAR_HEIGHT_M, ActorState, World
from pipeline.types import F32, F64, Sweep

CHANNELS = 16
ELEVATIONS_DEG = np.arange(-15.0, 16.0, 2.0)
_FIRING_S, _LASER_S, _ROTATION_S = 55.296e-6, 2.304e-6, 0.1
_FIRING_ORDER = np.array([2 * ring if ring < 8 else 2 * ring - 15 for ring in range(CHANNELS)])
"""Laser number of each ring: −15° fires first, then +1°, −13°, … (Velodyne manual 63-9243, table 9-1)."""
COLUMNS = round(_ROTATION_S / 2 / _FIRING_S)
MAX_RANGE_M = 100.0
RANGE_SIGMA_M = 0.015

# material: intensity 0–255, range at which half of the returns are lost (m), width of that fall-off (m), roughness (m)
ROAD, PAINT, GLASS, PLATE, METAL, FOLIAGE, WALL = range(7)
MATERIALS = np.array(
    [
        [9.0, 34.0, 7.0, 0.01],
        [34.0, 40.0, 4.5, 0.0],
        [4.0, 33.0, 5.0, 0.0],
        [160.0, 62.0, 6.0, 0.0],
        [60.0, 55.0, 8.0, 0.0],
        [22.0, 38.0, 12.0, 0.35],
        [48.0, 70.0, 12.0, 0.0],
    ]
)
_BOX_FIELDS = 9  # x y z, half length, half width, half height, cos yaw, sin yaw, material


def sweep(world: World, roadside: Roadside, seed: int, index: int, t_ns: int) -> Sweep:
    """The sweep of one moment, ego frame. The same seed and index give the same points."""
    boxes = scene_boxes(world, roadside)
    range_m, material = _cast(ray_directions(), boxes, LIDAR_HEIGHT_M)
    return _returns(range_m, material, np.random.default_rng([seed, 2, index]), t_ns)


def ray_directions() -> F64:
    """(COLUMNS, 16, 3) unit directions in firing order, from +90° (left) clockwise to −90°, the lowest ring first."""
    return _RAYS


def _make_rays() -> F64:
    turn_per_s = 2.0 * np.pi / _ROTATION_S
    fired_s = np.arange(COLUMNS)[:, None] * _FIRING_S + _FIRING_ORDER[None, :] * _LASER_S
    azimuth = np.pi / 2 - fired_s * turn_per_s
    elevation = np.radians(ELEVATIONS_DEG)[None, :]
    x, y = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth)
    return np.stack([x, y, np.broadcast_to(np.sin(elevation), x.shape)], axis=2)


_RAYS = _make_rays()


def scene_boxes(world: World, roadside: Roadside) -> F64:
    """(B, 9) boxes in reach: x y z of the middle, half sizes, cos and sin of the yaw, material."""
    rows: list[tuple[float, ...]] = []
    for state in world.actors:
        if np.hypot(*state.cuboid.center[:2]) < MAX_RANGE_M + 20.0:
            rows.extend(_vehicle_boxes(state))
    for thing, x, y, yaw in roadside.near(world, 20.0, MAX_RANGE_M + 10.0):
        rows.extend(_thing_boxes(thing, x, y, yaw))
    return np.array(rows, dtype=np.float64).reshape(-1, _BOX_FIELDS)


def _vehicle_boxes(state: ActorState) -> list[tuple[float, ...]]:
    length, width, height = state.cuboid.size
    match state.actor.kind:
        case "car":
            parts = [(0.0, 1.0, 1.0, 0.17, 0.69, PAINT), (-0.08, 0.58, 0.84, 0.69, 1.0, GLASS)]
            parts += [(-0.497, 0.008, 0.29, 0.5, 0.58, PLATE)]
        case "van":
            parts = [(0.0, 1.0, 1.0, 0.12, 0.55, PAINT), (-0.08, 0.84, 0.95, 0.55, 1.0, PAINT)]
            parts += [(-0.497, 0.008, 0.26, 0.32, 0.38, PLATE)]
        case "truck":
            parts = [(-0.1, 0.8, 1.0, 0.28, 1.0, WALL), (0.41, 0.18, 0.96, 0.12, 0.85, PAINT)]
            parts += [(-0.1, 0.78, 0.9, 0.1, 0.28, METAL)]
        case "bus":
            parts = [(0.0, 1.0, 1.0, 0.1, 0.45, PAINT), (0.0, 0.99, 0.98, 0.45, 1.0, GLASS)]
        case "motorcycle":
            parts = [(0.0, 1.0, 0.4, 0.1, 0.6, METAL), (-0.1, 0.35, 1.0, 0.5, 1.0, FOLIAGE)]
    x, y, _ = state.cuboid.center
    c, s = np.cos(state.cuboid.yaw_rad), np.sin(state.cuboid.yaw_rad)
    rows: list[tuple[float, ...]] = []
    for along, part_length, part_width, low, high, material in parts:
        ahead = along * length
        middle = (low + high) / 2 * height - LIDAR_HEIGHT_M
        half = (part_length * length / 2, part_width * width / 2, (high - low) / 2 * height)
        rows.append((x + ahead * c, y + ahead * s, middle, *half, c, s, float(material)))
    return rows


def _thing_boxes(thing: Thing, x: float, y: float, yaw: float) -> list[tuple[float, ...]]:
    c, s = np.cos(yaw), np.sin(yaw)

    def box(share: float, low_m: float, high_m: float, material: int) -> tuple[float, ...]:
        half = (thing.length_m / 2 * share, thing.width_m / 2 * share, (high_m - low_m) / 2)
        return (x, y, (low_m + high_m) / 2 - LIDAR_HEIGHT_M, *half, c, s, float(material))

    match thing.kind:
        case "tree":
            crown_from = thing.high_m - thing.length_m
            trunk = 0.3 / thing.length_m
            return [box(trunk, 0.0, crown_from, METAL), box(0.8, crown_from, thing.high_m, FOLIAGE)]
        case "building":
            return [box(1.0, thing.low_m, thing.high_m, WALL)]
        case "post":
            return [box(1.0, 0.0, thing.high_m, PLATE)]
        case _:
            return [box(1.0, thing.low_m, thing.high_m, METAL)]


@numba.njit(cache=True, nogil=True)
def _cast(rays: F64, boxes: F64, height_m: float) -> tuple[F64, npt.NDArray[np.int64]]:
    """Range and material of the first thing each ray meets, (COLUMNS, 16); infinity where it meets none."""
    columns, channels = rays.shape[0], rays.shape[1]
    range_m = np.full((columns, channels), np.inf)
    material = np.zeros((columns, channels), dtype=np.int64)
    for i in range(columns):
        for j in range(channels):
            if rays[i, j, 2] < 0.0:
                range_m[i, j] = -height_m / rays[i, j, 2]
    per_rad = (columns - 1) / np.pi
    for b in range(boxes.shape[0]):
        x, y, z, half_l, half_w, half_h, c, s = boxes[b, :8]
        first, last = 0, columns
        if x - abs(half_l * c) - abs(half_w * s) > 0.0:  # wholly ahead: only the columns that can meet it
            low, high = np.inf, -np.inf
            for k in range(4):
                dx, dy = half_l * (1 - 2 * (k // 2)), half_w * (1 - 2 * (k % 2))
                azimuth = np.arctan2(y + dx * s + dy * c, x + dx * c - dy * s)
                low, high = min(low, azimuth), max(high, azimuth)
            first = max(0, int((np.pi / 2 - high) * per_rad) - 2)
            last = min(columns, int((np.pi / 2 - low) * per_rad) + 3)
        # the sensor's place in the box's own axes
        ox, oy = -x * c - y * s, x * s - y * c
        for i in range(first, last):
            for j in range(channels):
                dx = rays[i, j, 0] * c + rays[i, j, 1] * s
                dy = rays[i, j, 1] * c - rays[i, j, 0] * s
                enter, leave = _slab(ox, dx, half_l, 0.0, range_m[i, j])
                enter, leave = _slab(oy, dy, half_w, enter, leave)
                enter, leave = _slab(-z, rays[i, j, 2], half_h, enter, leave)
                if 0.0 < enter < leave:
                    range_m[i, j] = enter
                    material[i, j] = int(boxes[b, 8])
    return range_m, material


@numba.njit(cache=True, nogil=True)
def _slab(start: float, direction: float, half: float, enter: float, leave: float) -> tuple[float, float]:
    """Cut the stretch enter…leave of a ray down to where it is between two planes at ±half."""
    if abs(direction) < 1e-12:
        return (enter, leave) if abs(start) <= half else (1.0, 0.0)
    near, far = (-half - start) / direction, (half - start) / direction
    if near > far:
        near, far = far, near
    return max(enter, near), min(leave, far)


def _returns(range_m: F64, material: npt.NDArray[np.int64], rng: np.random.Generator, t_ns: int) -> Sweep:
    """The points of the rays that come back: strong enough, with noise on their range."""
    chance, noise = rng.random(range_m.shape), rng.standard_normal(range_m.shape)
    intensity, half_range_m, fall_off_m, rough_m = np.moveaxis(MATERIALS[material], 2, 0)
    counted = range_m < MAX_RANGE_M
    range_m = np.where(counted, range_m, 0.0)
    counted &= chance < 1.0 / (1.0 + np.exp((range_m - half_range_m) / fall_off_m))
    measured = range_m + noise * np.hypot(RANGE_SIGMA_M, rough_m)
    column, ring = np.nonzero(counted)
    points: F32 = np.empty((len(column), 4), dtype=np.float32)
    points[:, :3] = _RAYS[column, ring] * measured[column, ring, None]
    points[:, 3] = np.clip(intensity[column, ring] * (1.0 + 0.1 * noise[column, ring]), 0.0, 255.0)
    return Sweep(t_ns, points, ring.astype(np.uint8), CHANNELS)
