"""Selects the objects other than the CIPV that ACC's TTC rule and emergency braking react to.

Braking for nothing is dangerous too, so an object must be reliable (ranged in this frame, confirmed, not a kerb or
post), and its course must lead into the corridor.
"""

from __future__ import annotations

from math import inf

from pipeline.decision.braking_evidence import has_ranged_velocity, is_ranged_steadily
from pipeline.decision.gates import ABREAST_M, OWN_HALF_WIDTH_M, is_solid
from pipeline.decision.path_position import SIDEWAYS_SIGMA_MPS, believed_mps
from pipeline.params import AebParams
from pipeline.path.estimates import STEP_M
from pipeline.types import Cipv, FusedObject, Path

_STOPS_WITH_MPS2 = 3.5
"""Strongest braking of a driver who means to give way: more is an emergency (ISO 15622 permits ACC as much)."""
_ON_FOOT = ("person", "bicycle")
"""Detectors call a cyclist one or the other."""
_HALF_A_PERSON_M = 0.25
_ACROSS = 0.7
"""Share of a speed that is lateral at more than 45° to the path."""
_SURE_SIGMAS = 2.0
"""Number of standard deviations of the path by which oncoming traffic must be inside the corridor."""


def is_dependable(item: FusedObject) -> bool:
    """Seen now, with a measured range, and all conditions of a lead met except class and position. A distance from box
    height alone gives too uncertain a speed to brake for an object that is not the lead, and so do too few sightings by
    the LiDAR since the last one far from the predicted position; a longer camera track does not improve this."""
    return has_ranged_velocity(item) and not item.carried and is_solid(item)


def is_there_now(item: FusedObject, params: AebParams) -> bool:
    """Whether this frame shows the object in the path. ``in_path`` follows from all sightings so far: a first one of
    two vehicles in one cluster keeps it up for half a second, and so does a place by the camera that the LiDAR
    corrects."""
    return not params.react_to_present or (item.path_margin_m is not None and item.path_margin_m >= 0.0)


def enters_corridor(item: FusedObject, path: Path, lead: Cipv | None, params: AebParams) -> bool:
    """Whether the object is in the corridor, or its lateral motion takes it there before the car reaches it. An object
    that stands or may stand beside the road stays there: its lateral speed is noise, and half of its points may vanish.
    Only persons step in.

    If the path's uncertainty exceeds its width, no course counts as leading into it: in a bend, other traffic follows
    the road, as the car will. Oncoming traffic, which keeps to its lane, must be in ours with high certainty where the
    two meet, also while it was seen for too short a time to be sure that it moves; where its lateral speed may be the
    jump to another of its sides, it must be in ours already. Oncoming or crossing objects behind the lead cannot be
    reached. What crosses and is gone before the car arrives is not met; its front enters first.

    What is in the corridor must be seen there in this frame as well.
    """
    if item.path_offset_m is None or item.velocity_mps is None or item.ttc_s is None or item.clears_path_s is not None:
        return False
    distance_m, oncoming = item.distance_m or 0.0, bool(item.oncoming)
    sigma_m = _sigma_m(path, distance_m)
    if oncoming or not item.in_path:
        is_hidden = lead is not None and distance_m > lead.distance_m
        if is_hidden or sigma_m > path.half_width_m:
            return False
    if not oncoming and item.in_path:
        return is_there_now(item, params)
    if item.closest_point is None or item.closest_point[0] < ABREAST_M:
        return False  # already beside the car: braking would not avoid it
    sideways = believed_mps(item.lateral_mps, item)
    if oncoming and params.react_where_met:
        met_m = abs(item.path_offset_m + sideways * item.ttc_s)
        if not is_ranged_steadily(item):
            met_m = max(met_m, abs(item.path_offset_m))
        return met_m + _SURE_SIGMAS * sigma_m <= path.half_width_m
    if not oncoming and item.surely_moving is False:
        return params.react_to_crossing and item.label in _ON_FOOT and _steps_in(item, path)
    toward = max(-sideways if item.path_offset_m > 0 else sideways, 0.0)
    aside_m = abs(item.path_offset_m) - toward * item.ttc_s
    if aside_m + (_SURE_SIGMAS * sigma_m if oncoming else 0.0) <= _reach_m(item, path):
        return True
    return params.react_to_crossing and not oncoming and _surely_drives_in(item, toward, item.ttc_s)


def _reach_m(item: FusedObject, path: Path) -> float:
    """How far from the middle of the path an object that comes in is in the way: to its edge; a person, of whom little
    is beside their middle, only before the car itself."""
    return min(OWN_HALF_WIDTH_M + _HALF_A_PERSON_M, path.half_width_m) if item.label == "person" else path.half_width_m


def _steps_in(item: FusedObject, path: Path) -> bool:
    """Whether a person on the edge of the path will be before the car when it arrives. Walking is hardly faster than
    what may be noise of a standing object, but nothing parked is called a person. One who is still beside the path may
    stop there within a step."""
    offset_m, sideways_mps = item.path_offset_m or 0.0, item.lateral_mps or 0.0
    toward_mps = (-sideways_mps if offset_m > 0.0 else sideways_mps) - SIDEWAYS_SIGMA_MPS
    aside_m = abs(offset_m) - max(toward_mps, 0.0) * (item.ttc_s or 0.0)
    return abs(offset_m) <= path.half_width_m + _HALF_A_PERSON_M and aside_m <= OWN_HALF_WIDTH_M


def _surely_drives_in(item: FusedObject, toward_mps: float, ttc_s: float) -> bool:
    """Whether the front of a crossing vehicle is over the edge of the path before the car is there, and its driver can
    hardly prevent it any more. The middle of its side, by which ``path_offset_m`` is measured, follows half a length
    later: for a car at 20 km/h, 0.4 s."""
    is_across = abs(item.lateral_mps or 0.0) > _ACROSS * (item.speed_over_ground_mps or inf)
    if not is_across or item.crossing_s is None or item.crossing_s > ttc_s:
        return False
    return toward_mps > 2.0 * _STOPS_WITH_MPS2 * item.crossing_s


def _sigma_m(path: Path, ahead_m: float) -> float:
    """Standard deviation of the path at this distance ahead."""
    profile = path.profile_m
    return float(profile[min(int(ahead_m / STEP_M), len(profile) - 1)]) if len(profile) else 0.0
