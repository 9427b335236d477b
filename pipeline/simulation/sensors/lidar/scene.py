"""The objects that the simulated LiDAR can hit: upright boxes of known material. A car is a body, a narrower cabin,
mostly of glass, and a reflective plate; a pedestrian is legs, torso and head."""

from __future__ import annotations

import numpy as np

from pipeline.simulation.sensors.lidar.rays import BOX_FIELDS
from pipeline.simulation.world.actors import ActorKind
from pipeline.simulation.world.roadside import Roadside, Thing
from pipeline.simulation.world.world_state import LIDAR_HEIGHT_M, ActorState, World
from pipeline.types import F64

MAX_RANGE_M = 100.0
ROAD, PAINT, GLASS, PLATE, METAL, FOLIAGE, WALL, CLOTH = range(8)
MATERIALS = np.array(
    [
        [9.0, 135.0, 4.0, 0.01, 1.0],
        [34.0, 44.0, 3.0, 0.0, 0.85],
        [4.0, 38.0, 3.0, 0.0, 0.36],
        [160.0, 62.0, 6.0, 0.0, 1.0],
        [60.0, 55.0, 8.0, 0.0, 0.95],
        [22.0, 38.0, 12.0, 0.35, 0.95],
        [48.0, 70.0, 12.0, 0.0, 1.0],
        [26.0, 44.0, 8.0, 0.03, 0.95],
    ]
)
"""For each material: intensity 0–255; range at which half of the returns are lost at normal incidence (m); width of
that fall-off (m); roughness (m); share of returns at close range, the rest is reflected away or transmitted. Paint,
glass and road are measured, ray by ray, on the labelled cars of real sweeps; the others are assumed."""
_DARKEST = 0.35

# The top of bonnet and boot lid slopes and sends light away as glass does.
# along the length: middle and extent; extent across; from and to height: shares of the vehicle's size; material
_PARTS: dict[ActorKind, tuple[tuple[float, float, float, float, float, int], ...]] = {
    "car": (
        (0.0, 1.0, 1.0, 0.17, 0.66, PAINT),
        (0.0, 0.98, 0.98, 0.66, 0.70, GLASS),
        (-0.08, 0.58, 0.84, 0.70, 1.0, GLASS),
        (-0.497, 0.008, 0.29, 0.5, 0.58, PLATE),
    ),
    "van": (
        (0.0, 1.0, 1.0, 0.12, 0.55, PAINT),
        (-0.08, 0.84, 0.95, 0.55, 1.0, PAINT),
        (-0.497, 0.008, 0.26, 0.32, 0.38, PLATE),
    ),
    "truck": (
        (-0.1, 0.8, 1.0, 0.28, 1.0, WALL),
        (0.41, 0.18, 0.96, 0.12, 0.85, PAINT),
        (-0.1, 0.78, 0.9, 0.1, 0.28, METAL),
    ),
    "bus": ((0.0, 1.0, 1.0, 0.1, 0.45, PAINT), (0.0, 0.99, 0.98, 0.45, 1.0, GLASS)),
    "motorcycle": ((0.0, 1.0, 0.4, 0.1, 0.6, METAL), (-0.1, 0.35, 1.0, 0.5, 1.0, FOLIAGE)),
    "bicycle": (
        (0.0, 1.0, 0.08, 0.0, 0.38, METAL),
        (0.23, 0.04, 1.0, 0.57, 0.6, METAL),
        (-0.08, 0.3, 0.6, 0.16, 0.55, CLOTH),
        (-0.1, 0.2, 0.72, 0.55, 0.83, CLOTH),
        (-0.06, 0.11, 0.3, 0.85, 1.0, CLOTH),
    ),
    "pedestrian": (
        (0.0, 0.75, 0.6, 0.0, 0.47, CLOTH),
        (0.0, 0.42, 1.0, 0.44, 0.82, CLOTH),
        (0.0, 0.32, 0.32, 0.86, 1.0, CLOTH),
    ),
}


def scene_boxes(world: World, roadside: Roadside) -> F64:
    """(B, 13) boxes in reach, ego frame, with their velocities relative to the ego vehicle."""
    rows: list[tuple[float, ...]] = []
    for state in world.actors:
        if np.hypot(*state.cuboid.center[:2]) < MAX_RANGE_M + 20.0:
            rows.extend(actor_boxes(state))
    actors = len(rows)
    for thing, x, y, yaw in roadside.near(world, 20.0, MAX_RANGE_M + 10.0):
        rows.extend(_thing_boxes(thing, x, y, yaw))
    boxes = np.array(rows, dtype=np.float64).reshape(-1, BOX_FIELDS)
    if world.hump_per_m:
        boxes[actors:, 2] += world.lift_m(boxes[actors:, 0])
    boxes[:, 9] += boxes[:, 1] * world.yaw_rate_radps - world.speed_mps
    boxes[:, 10] -= boxes[:, 0] * world.yaw_rate_radps
    boxes[:, 11] -= world.yaw_rate_radps
    return boxes


def actor_boxes(state: ActorState) -> list[tuple[float, ...]]:
    """The boxes of an actor, with its velocity over ground in ego axes."""
    length, width, height = state.cuboid.size
    x, y, z = state.cuboid.center
    c, s = float(np.cos(state.cuboid.yaw_rad)), float(np.sin(state.cuboid.yaw_rad))
    bright = _DARKEST + (1.0 - _DARKEST) * _brightness(state.actor.colour)
    rows: list[tuple[float, ...]] = []
    for along, part_length, part_width, low, high, material in _PARTS[state.actor.kind]:
        ahead = along * length
        middle = z + ((low + high) / 2 - 0.5) * height
        half = (part_length * length / 2, part_width * width / 2, (high - low) / 2 * height)
        velocity = (
            state.speed_mps * c - state.yaw_rate_radps * ahead * s,
            state.speed_mps * s + state.yaw_rate_radps * ahead * c,
        )
        reach = float(np.sqrt(bright)) if material == PAINT else 1.0
        place = (x + ahead * c, y + ahead * s, middle)
        rows.append((*place, *half, c, s, float(material), *velocity, state.yaw_rate_radps, reach))
    return rows


def _brightness(colour: str) -> float:
    """0 black … 1 white. The reflectance of paint at the laser's 903 nm is assumed to follow its visible brightness."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return 0.299 * red + 0.587 * green + 0.114 * blue


def _thing_boxes(thing: Thing, x: float, y: float, yaw: float) -> list[tuple[float, ...]]:
    c, s = float(np.cos(yaw)), float(np.sin(yaw))

    def box(share: float, low_m: float, high_m: float, material: int) -> tuple[float, ...]:
        half = (thing.length_m / 2 * share, thing.width_m / 2 * share, (high_m - low_m) / 2)
        middle = (low_m + high_m) / 2 - LIDAR_HEIGHT_M
        return (x, y, middle, *half, c, s, float(material), 0.0, 0.0, 0.0, 1.0)

    match thing.kind:
        case "tree":
            crown_from = thing.high_m - thing.length_m
            trunk = 0.3 / thing.length_m
            return [box(trunk, 0.0, crown_from, METAL), box(0.8, crown_from, thing.high_m, FOLIAGE)]
        case "building" | "wall" | "kerb":
            return [box(1.0, thing.low_m, thing.high_m, WALL)]
        case "hedge":
            return [box(1.0, thing.low_m, thing.high_m, FOLIAGE)]
        case "post":
            return [box(1.0, 0.0, thing.high_m, PLATE)]
        case _:
            return [box(1.0, thing.low_m, thing.high_m, METAL)]
