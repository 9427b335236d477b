"""Vehicles that cut in: the next lead while it is still beside the path.

Anything may seem to drive in: the first boxes of a far parked car, a hedge that comes into view bit by bit, a LiDAR
track that jumps to another side of an oncoming truck. In 706 frames of 20 random kilometres
(``pipeline.experiments.robustness``), an object's estimated lateral speed led into the path; in 45 of them it was a
vehicle that cut in. What cuts in surely exists, surely drives, and surely moves towards the path.
"""

from __future__ import annotations

from pipeline.decision.braking_evidence import is_ranged_steadily
from pipeline.decision.crossing import FEWEST_RANGES
from pipeline.decision.place import Place
from pipeline.params import CipvParams
from pipeline.types import VEHICLES, FusedObject


def cuts_in(item: FusedObject, where: Place | None, params: CipvParams) -> bool:
    """Whether a judged object will be in the path within ``cipv.cut_in_s``, and could lead there.

    where: its position relative to the path.
    """
    found = item.eligibility
    if where is None or found is None or item.carried or item.clears_path_s is not None:
        return False
    if item.crossing_s is None or item.crossing_s > params.cut_in_s or not _is_outside(item):
        return False
    if not (found.vehicle and found.distance and found.confirmed and found.size):
        return False
    return not params.prove_cut_in or (found.placed and _exists(item, params) and _surely_comes_in(item, where))


def _is_outside(item: FusedObject) -> bool:
    """Outside the path, or crossing its edge just now."""
    surely_in = item.in_path and item.eligibility is not None and item.eligibility.probable
    return not item.in_path or (not surely_in and item.crossing_s == 0.0)


def _exists(item: FusedObject, params: CipvParams) -> bool:
    """As for any new lead."""
    return item.existence is None or item.existence >= params.become_existence


def _surely_comes_in(item: FusedObject, where: Place) -> bool:
    """Whether it moves towards the middle of the path, and the motion is its own. Oncoming traffic keeps to its lane:
    it only seems to come in where the road bends."""
    if where.middle_m * where.believed_mps >= 0.0 or item.oncoming:
        return False
    is_followed = is_ranged_steadily(item) if item.ranged else item.camera_ranges >= FEWEST_RANGES
    return is_followed and _drives(item)


def _drives(item: FusedObject) -> bool:
    """Whether it surely drives. Without ego speed nobody knows: then it must be what both sensors see as a vehicle,
    because a car that turns makes everything beside it move sideways."""
    if item.surely_moving is not None:
        return item.surely_moving
    return item.ranged and item.imaged and item.label in VEHICLES
