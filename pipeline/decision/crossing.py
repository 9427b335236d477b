"""Vehicles that cross the path: they are in it only if they are still there when the car arrives.

At a red light, cross traffic passes in front of the car all the time. None of it is a vehicle to follow or to brake
for, because it leaves the path long before the car is there. A vehicle that crosses so slowly that the car would reach
it is in the path like any other.
"""

from __future__ import annotations

from math import inf

from pipeline.decision.braking_evidence import has_ranged_velocity
from pipeline.decision.place import Place
from pipeline.params import CipvParams
from pipeline.types import FusedObject

_SLOWEST_MPS = 1.0
"""Lateral speed, beyond its error, from which an object may be crossing: a walking pace. A slower one needs several
seconds to leave the path, in which it may as well stop."""
_FLANK_M = 3.2
"""Extent across the path from which an object shows its flank: no vehicle that drives along the path is as wide. Used
only without ego speed, when the speed along the path is not known."""
FEWEST_RANGES = 5
"""Distances in a row after which the camera alone knows a lateral speed: those of the first boxes of far vehicles
are off by up to 20 m/s."""
_ARRIVING_MPS = 0.5
"""If the gap shrinks more slowly than this, the car does not arrive."""
_LONGEST_S = 10.0
"""Nobody knows what either vehicle does later than this."""
_SIGMAS = 2.0
"""The other vehicle may be this many standard deviations nearer than measured."""


def clears_path_s(
    where: Place | None, item: FusedObject, ego_speed_mps: float | None, params: CipvParams
) -> float | None:
    """How long before the car arrives a crossing object will have left the path, at most 10 s; None for one that does
    not cross, or that the car might meet.

    ego_speed_mps: None while unknown.
    """
    if where is None or not params.use_crossing or not _has_velocity(item):
        return None
    sideways_mps = where.believed_mps
    if abs(sideways_mps) < _SLOWEST_MPS or not _crosses(where, ego_speed_mps is not None):
        return None
    outwards_m = where.left_m - where.middle_m if sideways_mps > 0.0 else where.right_m + where.middle_m
    leaves_s = max(outwards_m, 0.0) / abs(sideways_mps)
    closing_mps = (ego_speed_mps or 0.0) - where.forward_mps
    nearest_m = max(where.ahead_m - _SIGMAS * (item.distance_sigma_m or 0.0), 0.0)
    arrives_s = min(nearest_m / closing_mps if closing_mps > _ARRIVING_MPS else inf, _LONGEST_S)
    early_s = arrives_s - leaves_s
    return early_s if early_s > params.crossing_margin_s else None


def _has_velocity(item: FusedObject) -> bool:
    """Whether its lateral speed is known. What the LiDAR has only just found has the speed of its first boxes."""
    return has_ranged_velocity(item) or item.camera_ranges >= FEWEST_RANGES


def _crosses(where: Place, is_ego_speed_known: bool) -> bool:
    """Whether its course is across the path rather than along it."""
    if is_ego_speed_known:
        return abs(where.sideways_mps or 0.0) > abs(where.forward_mps)
    return where.high_m - where.low_m > _FLANK_M
