"""Limits how hard the car may brake for an object, by the evidence for it.

Full braking without a cause risks a rear-end collision from behind, so uncertain evidence must not cause it.
Comfortable deceleration costs little and is allowed for any lead. Emergency braking needs either the LiDAR, which
measures range and closing speed, or a camera that has tracked the object long enough to know its closing speed, and
only while the object is almost certainly in the path: an oncoming car in a bend is straight ahead until the road turns.

Full braking needs a LiDAR range too. A few single returns are enough if the camera has tracked the object for long:
they tell how tall it is, and with that its image boxes measure its speed. A standing car that is approached at 100 km/h
gives single returns at 40 to 50 m, but a third cluster only at 30 m, too late to stop.
"""

from __future__ import annotations

from pipeline.common.fast_replace import evolve
from pipeline.decision.object_motion import closing_speed_mps
from pipeline.params import ExistenceParams
from pipeline.types import Braking, FusedObject

_RANGED_SIGHTINGS = 3
"""After only two sightings, the LiDAR's velocity is the difference of two noisy positions: its speed is not known, and
it may point across the road."""
_SPEED_SHARE = 1.0 / 8.0
"""A closing speed with at most this relative error gives the deceleration required, which grows with its square, to
within a quarter."""
FRICTION_MPS2 = 9.8
"""Dry asphalt. If the camera alone has followed an object for a second and it now requires more braking than tyres can
deliver, the object was not overlooked until now; the track is wrong."""


def judge(objects: tuple[FusedObject, ...], params: ExistenceParams) -> tuple[FusedObject, ...]:
    """Each object with the hardest braking that its evidence justifies."""
    return tuple([_judged(item, _justified(item, params)) for item in objects])


def _judged(item: FusedObject, justifies: Braking) -> FusedObject:
    return item if item.justifies is justifies else evolve(item, justifies=justifies)


def _justified(item: FusedObject, params: ExistenceParams) -> Braking:
    if not params.enabled:
        return Braking.FULL if item.ranged else Braking.PARTIAL
    if item.existence is not None and item.existence < params.min_braking:
        return Braking.COMFORT
    is_steady = item.camera_ranges >= params.camera_ranges
    if item.ranged:
        # a camera track, however long, does not turn one LiDAR sighting into a measured speed
        return Braking.FULL if item.ranged_hits >= _RANGED_SIGHTINGS else Braking.PARTIAL
    is_in_path = (item.in_path_probability or 0.0) >= params.min_braking
    if not (is_steady and is_in_path):
        return Braking.COMFORT
    return Braking.FULL if has_known_height(item) and _has_known_speed(item) else Braking.PARTIAL


def has_ranged_velocity(item: FusedObject) -> bool:
    """Whether the LiDAR knows its velocity. What it has only just found has that of its image boxes."""
    return item.ranged and (not item.imaged or is_ranged_steadily(item))


def is_ranged_steadily(item: FusedObject) -> bool:
    """Whether the LiDAR has seen it where it was expected for long enough that its velocity is no jump, as when another
    side of it comes into view or the box leaves its cluster."""
    return item.ranged_steady >= _RANGED_SIGHTINGS


def has_known_height(item: FusedObject) -> bool:
    """Whether the LiDAR has ranged this vehicle, so that its image boxes are measurements of its distance."""
    return item.height_from == "range"


def _has_known_speed(item: FusedObject) -> bool:
    closing, sigma = closing_speed_mps(item), item.camera_speed_sigma_mps
    return closing is not None and sigma is not None and sigma <= _SPEED_SHARE * closing
