"""Matching of the pipeline's objects with labelled vehicles, and their errors (paper, Table 4)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.common.geometry import F64, iou_matrix
from pipeline.common.near_face import near_face_middle
from pipeline.evaluation.lead_verdict import LABELLED_VEHICLES, SAME_BOX_IOU, nearest_face_m
from pipeline.evaluation.scores.truth import FrameTruth
from pipeline.params import CipvParams
from pipeline.types import VEHICLES, Box, FusedObject, ObjectSource, Point2, Result
from pipeline.types.source import TruthObject

MAX_RANGE_M = 60.0
HALF_ANGLE_RAD = np.radians(35.0)
"""Vehicles are scored up to this range and this angle to either side: about the field of view of a front camera."""
SIDE_M, LEAST_M = 2.5, 2.0
RANGED_SHARE, UNRANGED_SHARE = 0.15, 0.35
"""An object may match a vehicle up to ``SIDE_M`` laterally, and longitudinally up to this share of its range: the first
for objects with measured range, the second for those with range from the box height. A measured range is either correct
or of another object; one from a box height may be off by a third."""
CONFIRM_HITS = CipvParams().confirm_hits
_LESS_M = 1e-6
"""By this, a pair at its limit is preferred to a missed vehicle."""


class Error(NamedTuple):
    """One matched vehicle in one frame. Errors are estimated minus true, of the nearest face's middle."""

    source: ObjectSource
    """Which sensors see it."""
    range_m: float
    """True range."""
    distance_m: float
    """Error of the distance."""
    lateral_m: float
    """Error across the ego car's axis."""
    longitudinal_m: float
    """Error along it."""
    speed_mps: float | None
    """Error of the longitudinal velocity; None if either is unknown."""
    distance_sigma_m: float | None = None
    """Reported standard deviation of the distance; None without one."""


def vehicles(objects: Iterable[TruthObject]) -> list[TruthObject]:
    """The labelled vehicles that are scored."""
    return [item for item in objects if item.label.lower() in LABELLED_VEHICLES and _looked_for(item)]


def _looked_for(item: TruthObject) -> bool:
    x, y, _ = item.cuboid.center
    return x > 0.0 and abs(np.arctan2(y, x)) <= HALF_ANGLE_RAD and nearest_face_m(item) <= MAX_RANGE_M


def face_of(item: TruthObject) -> Point2:
    """The middle of a labelled cuboid's nearest face, ego x, y."""
    a, b, c, d = ((float(x), float(y)) for x, y in item.cuboid.footprint())
    return near_face_middle((a, b, c, d))


def errors(result: Result, truth: FrameTruth) -> tuple[Error, ...]:
    """One per labelled vehicle that matches an object seen in this frame, whatever the object's class: only its
    position is scored here."""
    wanted = vehicles(truth.objects)
    seen = [
        item for item in result.objects if item.bev is not None and item.distance_m is not None and not item.carried
    ]
    return tuple(_error(seen[k], wanted[n], truth) for n, k in _pairs(wanted, seen))


def _pairs(wanted: Sequence[TruthObject], seen: Sequence[FusedObject]) -> list[tuple[int, int]]:
    """One-to-one assignment with the smallest total distance, where a missed vehicle costs as much as the farthest
    object that could be it. (Maximising the number of pairs would give a missed vehicle its neighbour's object, and the
    neighbour a ghost.)"""
    if not wanted or not seen:
        return []
    true = np.array([face_of(item) for item in wanted])
    believed = _faces(seen)
    off = np.abs(believed[None] - true[:, None])
    ranges = np.array([nearest_face_m(item) for item in wanted])
    shares = np.array([RANGED_SHARE if item.ranged else UNRANGED_SHARE for item in seen])
    reach = np.maximum(LEAST_M, ranges[:, None] * shares[None])
    away = np.abs(np.array([item.distance_m for item in seen])[None] - ranges[:, None])
    allowed = (off[..., 1] <= SIDE_M) & (away <= reach)
    missed = np.hypot(SIDE_M, np.maximum(LEAST_M, ranges * UNRANGED_SHARE))[:, None]
    cost = np.where(allowed, np.minimum(np.hypot(off[..., 0], off[..., 1]), missed - _LESS_M), missed)
    rows, columns = linear_sum_assignment(cost)
    return [(int(n), int(k)) for n, k in zip(rows, columns, strict=True) if allowed[n, k]]


def _faces(seen: Sequence[FusedObject]) -> F64:
    """(K, 2) middles of nearest faces."""
    return np.array([near_face_middle(item.bev) for item in seen if item.bev is not None])


def _error(item: FusedObject, true: TruthObject, truth: FrameTruth) -> Error:
    (x, y), (true_x, true_y) = _faces([item])[0], face_of(true)
    range_m = nearest_face_m(true)
    velocity = (truth.velocity_mps or {}).get(true.id) if true.id is not None else None
    known = velocity is not None and item.velocity_mps is not None
    speed = item.velocity_mps[0] - velocity[0] if known else None  # type: ignore[index]
    distance_m = float(item.distance_m or 0.0) - range_m
    return Error(item.source, range_m, distance_m, float(y - true_y), float(x - true_x), speed, item.distance_sigma_m)


def claims(
    result: Result, wanted: Sequence[TruthObject], within_m: float, unplaced: Sequence[Box] = ()
) -> list[FusedObject]:
    """The objects to be scored as vehicle detections: those of a vehicle class, in the scored field of view, seen in
    this frame, and by both sensors or often enough (as for a lead).

    A LiDAR object without a class is not reported as a vehicle: it counts if it lies within ``within_m`` of a labelled
    vehicle that no classified object matches, and is otherwise ignored, like roadside returns. An object far from every
    labelled position whose image box matches one of ``unplaced`` is also ignored: there is a vehicle, but its distance
    is unknown.
    """
    placed = [item for item in result.objects if item.bev is not None and item.distance_m is not None]
    field = [item for item in placed if not item.carried and _is_confirmed(item) and _in_field(item)]
    faces = np.array([face_of(true) for true in wanted]).reshape(-1, 2)
    named = [item for item in field if item.label in VEHICLES]
    named = [item for item in named if _is_near(item, faces, within_m) or not _is_in_one_of(item, unplaced)]
    places = _faces(named).reshape(-1, 2)
    nameless = [item for item in field if item.label is None]
    extra: list[FusedObject] = []
    for face in faces:
        if len(places) and np.hypot(*(places - face).T).min() <= within_m:
            continue
        near = [(float(np.hypot(*(_faces([item])[0] - face))), item) for item in nameless if item not in extra]
        distance, item = min(near, key=lambda pair: pair[0], default=(np.inf, None))
        if item is not None and distance <= within_m:
            extra.append(item)
    return named + extra


def _is_near(item: FusedObject, places: F64, within_m: float) -> bool:
    return bool(len(places)) and bool(np.hypot(*(places - _faces([item])[0]).T).min() <= within_m)


def _is_in_one_of(item: FusedObject, boxes: Sequence[Box]) -> bool:
    if item.bbox is None or not boxes:
        return False
    return bool(iou_matrix(np.array([item.bbox]), np.array(boxes)).max() >= SAME_BOX_IOU)


def _is_confirmed(item: FusedObject) -> bool:
    return item.tracked_by_two_sensors or item.hits >= CONFIRM_HITS


def _in_field(item: FusedObject) -> bool:
    x, y = _faces([item])[0]
    return bool(x > 0.0 and abs(np.arctan2(y, x)) <= HALF_ANGLE_RAD and (item.distance_m or 0.0) <= MAX_RANGE_M)
