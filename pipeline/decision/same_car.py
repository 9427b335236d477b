"""One car as two objects: which of them is the lead, so that its distance is the better one and its number stays."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import NamedTuple

from pipeline.fusion.last_place import AGREEMENT_SIGMAS
from pipeline.types import FusedObject

_LENGTH_M, _WIDTH_M = 3.0, 1.0
"""A car is longer and wider than these."""
_WRONG_SHARE = 0.5
"""By how much a box may place a vehicle too far away or too near, as a share: a van that is called a car, half of a
car, and a little more. Three standard deviations alone would reach from 70 m to 35 m."""


class Rival(NamedTuple):
    """Another view of the lead that would be the better one."""

    id: int
    """Of the object."""
    frames: int
    """For how many frames in a row."""


def surer(nearest: FusedObject, able: Sequence[FusedObject]) -> FusedObject:
    """The nearest candidate, or a better measured one that is probably the same car. One car has two rows if its box
    and its cluster were not joined, or if it was lost and found again under another id. If the two distances agree, a
    carried row yields to one seen now, and a camera-only row to one with a measured range."""
    rank = surety(nearest)
    same_place = [item for item in able if surety(item) > rank and _agree(nearest, item)]
    return min(same_place, key=lambda item: (item.distance_m or 0.0, item.id), default=nearest)


def the_same(
    lead_id: int | None, rival: Rival | None, best: FusedObject, able: Sequence[FusedObject], frames: int
) -> tuple[FusedObject, Rival | None]:
    """The previous lead instead of another view of what is probably the same car, until that has been the better one
    for ``frames`` frames; and that view. A vehicle's box and cluster may be two objects for a frame, and each has the
    better distance now and then: the lead keeps its number."""
    lead = next((item for item in able if item.id == lead_id), None)
    if lead is None or lead.id == best.id:
        return best, None
    yields = (best.distance_m or 0.0) > (lead.distance_m or 0.0)  # to the better measured view, not to a nearer car
    if not yields and not _is_one_car(lead, best):
        return best, None
    count = rival.frames + 1 if rival is not None and rival.id == best.id else 1
    return (lead, Rival(best.id, count)) if count < frames else (best, None)


def surety(item: FusedObject) -> int:
    """How well an object's distance is measured: 0 carried, 1 by the camera, 2 by a sensor that measures range."""
    return 0 if item.carried else 2 if item.ranged else 1


def _is_one_car(a: FusedObject, b: FusedObject) -> bool:
    """Whether two objects in the path are closer together, along it and across, than two cars can be."""
    apart_m = abs((a.distance_m or 0.0) - (b.distance_m or 0.0))
    aside_m = abs((a.path_offset_m or 0.0) - (b.path_offset_m or 0.0))
    return apart_m < _LENGTH_M and aside_m < _WIDTH_M


def _agree(a: FusedObject, b: FusedObject) -> bool:
    """Whether two distances agree within three standard deviations of both, and may be those of one vehicle at all."""
    if a.distance_m is None or b.distance_m is None:
        return False
    sigma, apart_m = hypot(a.distance_sigma_m or 0.0, b.distance_sigma_m or 0.0), abs(a.distance_m - b.distance_m)
    return apart_m <= min(AGREEMENT_SIGMAS * sigma, _WRONG_SHARE * min(a.distance_m, b.distance_m))
