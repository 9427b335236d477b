"""Which true vehicle an object of the results is, and the words in which failures are counted."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, cos, dist, hypot, sin

import numpy as np

from pipeline.common.geometry import iou_matrix
from pipeline.common.near_face import near_face_middle
from pipeline.evaluation.lead_verdict import SAME_BOX_IOU
from pipeline.experiments.true_lead import range_m, same_place
from pipeline.simulation.sensors.truth_boxes import in_image
from pipeline.simulation.world.world_state import ActorState, World
from pipeline.types import CameraCalibration, FusedObject, Point2
from pipeline.types.sensors import are_several, kinds_in

_PARKED, _ONCOMING, _BESIDE, _CROSSING, _PEOPLE = 100, 1000, 2000, 3000, 4000
"""First number of each part of the random traffic (``traffic``, ``people``)."""


def place(item: FusedObject | None) -> Point2 | None:
    """Ego x, y of an object's nearest face; None if its position is unknown."""
    if item is None:
        return None
    if item.bev is not None:
        return near_face_middle(item.bev)
    return item.closest_point[:2] if item.closest_point is not None else None


def vehicles_at(now: World, where: Point2) -> list[ActorState]:
    """The true vehicles that an object believed to be at a position may be."""
    reach_m = 20.0 + 0.25 * hypot(*where)
    near = [state for state in now.actors if dist(where, state.cuboid.center[:2]) < reach_m]
    return [state for state in near if same_place(where, state) or _inside(where, state)]


def vehicle_in_box(now: World, camera: CameraCalibration | None, item: FusedObject | None) -> ActorState | None:
    """The true vehicle whose box in the image matches that of an object; None without one."""
    seen = in_image(now, camera) if camera is not None and item is not None and item.bbox is not None else ()
    if not seen or item is None:
        return None
    overlaps = iou_matrix(np.array([item.bbox]), np.array([each.bbox for each in seen]))[0]
    best = int(overlaps.argmax())
    return seen[best].actor if overlaps[best] >= SAME_BOX_IOU else None


def how_misplaced(state: ActorState, where: Point2) -> str:
    """How a true vehicle is misplaced, as text by which failures are grouped."""
    return f"true vehicle placed too {'near' if hypot(*where) < range_m(state) else 'far'}"


def named(state: ActorState) -> str:
    """A true vehicle as text, for example "car 1 at 52.3 m"."""
    return f"{state.actor.kind} {state.actor.id} at {range_m(state):.1f} m"


def is_hit(state: ActorState) -> bool:
    """Whether the middle of the ego vehicle's bumper is inside a vehicle."""
    return _inside((0.0, 0.0), state, 0.0)


def _inside(where: Point2, state: ActorState, around_m: float = 1.0) -> bool:
    """Whether a position is on a vehicle or within ``around_m`` of it. The nearest face alone would not do, since it is
    far from the side of a long vehicle."""
    x, y = where[0] - state.cuboid.center[0], where[1] - state.cuboid.center[1]
    c, s = cos(state.cuboid.yaw_rad), sin(state.cuboid.yaw_rad)
    length, width, _ = state.cuboid.size
    return abs(x * c + y * s) < length / 2 + around_m and abs(y * c - x * s) < width / 2 + around_m


def what(met: Sequence[ActorState]) -> str:
    """The part of the traffic to which these vehicles belong."""
    if not met:
        return "nothing there"
    number = min(state.actor.id for state in met)
    if number >= _PEOPLE:
        return "pedestrian"
    if number >= _CROSSING:
        return "crossing vehicle"
    if number >= _BESIDE:
        return "vehicle in the next lane"
    if number >= _ONCOMING:
        return "oncoming vehicle"
    return "parked vehicle" if number >= _PARKED else "vehicle in another lane"


def seen_by(item: FusedObject | None) -> str:
    """The sensors that an object is based on."""
    if item is None:
        return "nobody"
    return "both" if are_several(item.source) else kinds_in(item.source)[0].title


def why_missed(lead: ActorState, chosen: FusedObject | None) -> str:
    """What was chosen instead of a true lead, and its distance in steps of 20 m."""
    away_m = hypot(*lead.cuboid.center[:2]) - lead.cuboid.size[0] / 2
    choice = "no lead" if chosen is None else "another object leads"
    return f"{choice}, true lead within {20 * ceil(away_m / 20)} m"
