"""Of far vehicles that the LiDAR touches at all, how many have a LiDAR range.

    python -m tests.soak.far_ranges

Each Astyx frame of ``CIPV_DATA`` is processed on its own. A labelled vehicle within ``ASIDE_M`` of the car's axis at 40
to 70 m counts if a return above the road lies in its cuboid. It has a range if an object with a cluster or returns of
this sweep is within ``NEAR_M`` of it, along the road and across.
"""

from __future__ import annotations

import numpy as np

from pipeline.common.files.data_dir import data_dir
from pipeline.common.geometry import F64
from pipeline.params import Params, with_changes
from pipeline.step import State, step
from pipeline.types import VEHICLES, FusedObject
from pipeline.types.source import TruthObject
from tests.soak.range_parts import opened

ASIDE_M, NEAR_M = 4.0, 2.0
FROM_M, TO_M = 40.0, 70.0
_ROAD_M = 0.25
"""Returns lower in a cuboid may be of the road."""
_ROOM_M = 0.3, 0.2, 0.3
"""Around a cuboid, at its ends, its sides and its top: labels are not exact."""


def is_touched(points: F64, item: TruthObject) -> bool:
    """Whether one of the points (N, 3) lies in the cuboid, above the road."""
    length, width, height = item.cuboid.size
    cos, sin = np.cos(item.cuboid.yaw_rad), np.sin(item.cuboid.yaw_rad)
    x, y, z = (points - np.array(item.cuboid.center)).T
    along, across = np.abs(x * cos + y * sin), np.abs(y * cos - x * sin)
    inside = (along < length / 2 + _ROOM_M[0]) & (across < width / 2 + _ROOM_M[1])
    return bool((inside & (z > _ROAD_M - height / 2) & (z < height / 2 + _ROOM_M[2])).any())


def is_ranged(items: tuple[FusedObject, ...], item: TruthObject, distance_m: float) -> bool:
    """Whether the LiDAR ranges one of the objects where the vehicle is."""
    return any(
        found.distance_m is not None
        and found.closest_point is not None
        and (found.ranged_now or found.returns > 0)
        and abs(found.distance_m - distance_m) < NEAR_M
        and abs(found.closest_point[1] - item.cuboid.center[1]) < NEAR_M
        for found in items
    )


def main() -> None:
    folder, params = data_dir(), with_changes(Params(), {"cipv.confirm_hits": 1})
    touched = ranged = 0
    for name in ("astyx", "astyx_more"):
        for frame, truth in opened(f"astyx:{folder / name}"):
            _, result = step(State(), frame, params)
            points = result.layers.points[:, :3].astype(np.float64)
            for item in truth or ():
                corners = item.cuboid.corners()
                distance_m = float(np.hypot(corners[:, 0], corners[:, 1]).min())
                is_asked = item.label in VEHICLES and FROM_M <= distance_m < TO_M
                if is_asked and abs(item.cuboid.center[1]) < ASIDE_M and is_touched(points, item):
                    touched += 1
                    ranged += is_ranged(result.objects, item, distance_m)
    print(f"{ranged} of {touched} vehicles at {FROM_M:.0f} to {TO_M:.0f} m with a return have a LiDAR range")


if __name__ == "__main__":
    main()
