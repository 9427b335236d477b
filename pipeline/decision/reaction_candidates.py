"""Selects the objects other than the CIPV that ACC's TTC rule and emergency braking react to.

Braking for nothing is dangerous too, so an object must be reliable (ranged in this frame, confirmed, not a kerb or
post), and its course must lead into the corridor.
"""

from __future__ import annotations

from pipeline.decision.gates import ABREAST_M, is_solid
from pipeline.decision.path_position import believed_mps
from pipeline.types import FusedObject, Path

_VELOCITY_HITS = 3
"""After two sightings the LiDAR's velocity is the difference of two noisy positions, which may point across the road.
That the camera has followed the object for longer does not help."""


def is_dependable(item: FusedObject) -> bool:
    """Seen now, with a measured range, and every condition of a lead met but class and place. A box height alone says
    too little about speed to brake for what is not even the lead."""
    has_velocity = item.ranged and (not item.imaged or item.lidar_hits >= _VELOCITY_HITS)
    return has_velocity and not item.carried and is_solid(item)


def enters_corridor(item: FusedObject, path: Path) -> bool:
    """Whether the object is in the corridor, or its sideways motion takes it there before the car reaches it. What
    stands still beside the road stays there: its sideways speed is noise."""
    if item.path_offset_m is None or item.velocity_mps is None or item.ttc_s is None:
        return False
    if item.in_path or item.moving is False:
        return item.in_path
    if item.closest_point is None or item.closest_point[0] < ABREAST_M:
        return False  # beside the car already: braking would not avoid it
    sideways = believed_mps(item.lateral_mps, item)
    toward = -sideways if item.path_offset_m > 0 else sideways
    return abs(item.path_offset_m) - max(toward, 0.0) * item.ttc_s <= path.half_width_m
