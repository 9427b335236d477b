"""Finds the first object that a ray through the scene hits."""

from __future__ import annotations

import numpy as np

from pipeline.common.geometry import F64
from pipeline.types import FusedObject, Point3

MARGIN_M = 0.3
"""A ray this close to a box hits it, since pointers are imprecise and far cars are small."""
_UNKNOWN_HEIGHT_M = 1.5
"""Height assumed for a footprint without a cuboid, typical of cars."""


def object_on_ray(objects: tuple[FusedObject, ...], origin: Point3, direction: Point3, floor_m: float) -> int | None:
    """The id of the first object on the ray; None without one. Ego frame, metres; ``floor_m`` is the ground's height,
    used for footprints not measured by the LiDAR."""
    start, along = np.asarray(origin, dtype=np.float64), np.asarray(direction, dtype=np.float64)
    met = [(distance, each.id) for each in objects if (distance := _distance(each, start, along, floor_m)) is not None]
    return min(met)[1] if met else None


def _distance(each: FusedObject, start: F64, along: F64, floor_m: float) -> float | None:
    """Where the ray enters the object's box, in multiples of ``along``; None if it misses."""
    if each.cuboid is not None:
        center, size, yaw_rad = np.asarray(each.cuboid.center), np.asarray(each.cuboid.size), each.cuboid.yaw_rad
    elif each.bev is not None:
        corners = np.asarray(each.bev)
        edge = corners[0] - corners[3]
        size = np.array([np.hypot(*edge), np.hypot(*(corners[0] - corners[1])), _UNKNOWN_HEIGHT_M])
        center, yaw_rad = np.array([*corners.mean(axis=0), floor_m + _UNKNOWN_HEIGHT_M / 2]), np.arctan2(*edge[::-1])
    else:
        return None
    to_box = np.array([[np.cos(yaw_rad), np.sin(yaw_rad), 0.0], [-np.sin(yaw_rad), np.cos(yaw_rad), 0.0], [0, 0, 1.0]])
    return _entered(to_box @ (start - center), to_box @ along, size / 2 + MARGIN_M)


def _entered(start: F64, along: F64, half: F64) -> float | None:
    """Slab test for the box from −half to half: where the ray enters it, 0 from inside, None if it misses."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(-half - start) / along, (half - start) / along])
    level = along == 0.0
    if (np.abs(start[level]) > half[level]).any():
        return None
    near = float(np.max(ends.min(axis=0)[~level], initial=0.0))
    far = float(np.min(ends.max(axis=0)[~level], initial=np.inf))
    return near if near <= far else None
