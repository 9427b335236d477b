"""Checks whether camera and LiDAR agree. If they disagree for long, one of them is not mounted where the calibration
says.

A wrong mount or calibration does not show in a single object, since each is a plausible car. It shows in pairs: a car
seen by the camera alone, and beside it, at the same distance, a cluster as wide as a car seen by the LiDAR alone. The
share of such pairs among the vehicles near enough for both sensors is averaged over time.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, exp, hypot, radians

from pipeline.common.fast_replace import evolve
from pipeline.params import FusionParams
from pipeline.types import VEHICLES, FusedObject, Path

_REACH_M = 35.0
"""Farther away, a sweep may hit a car too rarely to form a cluster."""
_CONFIRMED = 3
"""Measurements of a track before it is evidence."""
_NARROWEST_M, _WIDEST_M = 1.2, 6.0
_SAME_RANGE_SIGMAS, _APART_RAD = 1.5, radians(8.0)


@dataclass(frozen=True)
class AgreementState:
    """Recent agreement of camera and LiDAR."""

    share: float = 0.0
    """Share of vehicles, 0–1, that both sensors should see but do not match: a running mean."""


def follow(
    state: AgreementState, objects: tuple[FusedObject, ...], dt_s: float | None, params: FusionParams
) -> AgreementState:
    """The share after this frame; unchanged if neither sensor sees anything near."""
    # Among near objects that both sensors should see, the share seen by only one of them; averaged over time
    near = [item for item in objects if item.distance_m is not None and item.distance_m <= _REACH_M]
    joined = sum(item.seen_by_two_sensors for item in near)
    apart = _come_apart(near)
    if not dt_s or not joined + apart:
        return state
    fresh = 1.0 - exp(-dt_s / params.disagree_s)
    return AgreementState(state.share + fresh * (apart / (joined + apart) - state.share))


def heed(path: Path, state: AgreementState, params: FusionParams) -> Path:
    """The path, marked as not usable while the sensors disagree: a lead may then be outside the searched area."""
    if state.share < params.disagree_share:
        return path
    doubt = "camera and LiDAR disagree about where cars are"
    return evolve(
        path,
        usable=False,
        doubt=doubt,
        confidence=path.confidence * (1.0 - state.share),
        notes=(*path.notes, f"{doubt}: check the calibration"),
    )


def _come_apart(near: list[FusedObject]) -> int:
    """Number of pairs of a camera-only car and a LiDAR-only cluster at the same distance with a small lateral offset;
    each cluster is used once."""
    clusters = [item for item in near if not item.imaged and not item.carried and _is_a_car_wide(item)]
    count = 0
    for box in near:
        if not box.ranged and not box.carried and box.label in VEHICLES and box.hits >= _CONFIRMED:
            partner = next((each for each in clusters if _are_apart(box, each)), None)
            if partner is not None:
                clusters.remove(partner)
                count += 1
    return count


def _is_a_car_wide(item: FusedObject) -> bool:
    if item.cuboid is None or item.hits < _CONFIRMED:
        return False
    length, width, _ = item.cuboid.size
    return _NARROWEST_M <= max(length, width) <= _WIDEST_M


def _are_apart(box: FusedObject, cluster: FusedObject) -> bool:
    """Whether both are at the same distance but in directions too different for fusion to join them."""
    if box.closest_point is None or cluster.closest_point is None:
        return False
    sigma_m = hypot(box.distance_sigma_m or 0.0, cluster.distance_sigma_m or 0.0)
    if abs((box.distance_m or 0.0) - (cluster.distance_m or 0.0)) > _SAME_RANGE_SIGMAS * sigma_m:
        return False
    turn = atan2(box.closest_point[1], box.closest_point[0]) - atan2(cluster.closest_point[1], cluster.closest_point[0])
    return abs(turn) <= _APART_RAD
