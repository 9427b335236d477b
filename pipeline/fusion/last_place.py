"""Whether an object is where it was one frame ago, so that what was found out about it there still holds."""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

from pipeline.types import FusedObject

AGREEMENT_SIGMAS = 3.0
"""Two distances of one object differ by less than this many standard deviations of both."""
_APPROACH_M = 4.0
"""By so much a distance may change between two frames: 40 m/s for a tenth of a second."""


class LastPlace(NamedTuple):
    """What an object's position was based on in the previous frame."""

    camera_ranges: int
    """Number of distances that the camera's position was based on."""
    distance_m: float | None
    """Its distance."""
    sigma_m: float
    """Standard deviation of that."""
    ranged: bool
    """Whether a sensor that measures range followed it."""


def last_place(item: FusedObject) -> LastPlace:
    """What the position of an object is based on."""
    return LastPlace(item.camera_ranges, item.distance_m, item.distance_sigma_m or 0.0, item.ranged)


def is_elsewhere(item: FusedObject, before: LastPlace | None, at_takeover: bool) -> bool:
    """Whether nothing found out about its last position holds for this one: the camera starts anew, because its
    distances no longer fitted; or one of a ranging sensor and the camera takes over from the other, and finds it at a
    distance that contradicts the other's. Its boxes may be those of another vehicle now, or may have been.

    at_takeover: whether such a distance counts.
    """
    if before is None:
        return False
    if not item.ranged and item.camera_ranges < before.camera_ranges:
        return True
    if not at_takeover or item.ranged == before.ranged or before.distance_m is None or item.distance_m is None:
        return False
    spread_m = AGREEMENT_SIGMAS * hypot(before.sigma_m, item.distance_sigma_m or 0.0)
    return abs(item.distance_m - before.distance_m) > spread_m + _APPROACH_M
