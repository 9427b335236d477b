"""Synthetic sweeps of static structures for odometry: a street of poles and house fronts, a tunnel, an open road."""

from __future__ import annotations

import numpy as np

from pipeline.types import F64, Ground, Sweep

ROAD = Ground(np.zeros(0, np.bool_), np.array([[0.0, 0.0, 1.0, 1.7]]), np.array([-100.0, 100.0]), np.array([True]))
"""Flat, 1.7 m below the sensor."""
_HEIGHTS = np.array([-1.2, -0.6, 0.0, 0.6, 1.2])


def street(seed: int = 1) -> F64:
    """(N, 2) positions of poles and of house fronts with gaps and steps between them, along 200 m."""
    random = np.random.default_rng(seed)
    places = [np.column_stack([random.uniform(-60.0, 140.0, 60), random.choice([-1.0, 1.0], 60) * 6.0])]
    for side in (-1.0, 1.0):
        x = -60.0
        while x < 140.0:
            length, back = random.uniform(6.0, 14.0), random.uniform(9.0, 13.0)
            along = np.arange(0.0, length, 0.2)
            places.append(np.column_stack([x + along, np.full(len(along), side * back)]))
            across = np.arange(0.0, 6.0, 0.2)
            places.append(np.column_stack([np.full(len(across), x + length), side * (back + across)]))
            x += length + random.uniform(2.0, 5.0)
    return np.concatenate(places)


def tunnel() -> F64:
    """(N, 2) positions of two smooth walls."""
    x = np.arange(-60.0, 140.0, 0.2)
    return np.concatenate([np.column_stack([x, np.full(len(x), side * 5.0)]) for side in (-1.0, 1.0)])


def seen(world: F64, x_m: float, y_m: float, heading_rad: float, t_ns: int) -> Sweep:
    """The sweep of a LiDAR at this pose, with 2 cm of independent noise."""
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    local = (world - [x_m, y_m]) @ np.array([[c, -s], [s, c]])
    local = local[np.hypot(local[:, 0], local[:, 1]) < 45.0]
    points = np.column_stack(
        [np.repeat(local, len(_HEIGHTS), 0), np.tile(_HEIGHTS, len(local)), np.zeros(len(local) * len(_HEIGHTS))]
    )
    points[:, :3] += np.random.default_rng(t_ns % 2**32).normal(0.0, 0.02, (len(points), 3))
    return Sweep(t_ns, points.astype(np.float32), np.zeros(len(points), np.uint8), 16)
