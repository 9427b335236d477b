"""Which vehicle ahead is the closest one in the path, why this one, and why not each other (paper, section CIPV).

The rule, in one place: among the objects that may be a lead at all (``_ELIGIBILITY``), the one in the path with the
smallest distance. Each test leaves its number and limit on the object; the first that fails is the reason given.
"""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from pipeline.geometry import F64
from pipeline.motion import closing_speed_mps
from pipeline.params import CipvParams
from pipeline.path.corridor import nearest_on_path
from pipeline.records import evolve
from pipeline.types import VEHICLES, Cipv, FusedObject, Gate, Path, Point2, Rejection

SMALLEST_SIGMA_M = 0.1
AGREEMENT_SIGMAS = 3.0


class Candidate(NamedTuple):
    """An object with what its tests need to know: its place against the path, whether it led in the frame before, and
    how far from the path's centre it may be."""

    item: FusedObject
    place: Place | None
    leads: bool
    limit_m: float
    params: CipvParams


class Check(NamedTuple):
    """One question to a candidate: the gate with its number, and the sentence that says why it failed."""

    gate: Gate
    reason: str


def choose(
    objects: tuple[FusedObject, ...], path: Path, last_lead: int | None, params: CipvParams
) -> tuple[tuple[FusedObject, ...], Cipv | None, tuple[Rejection, ...]]:
    """The objects with their place against the path and every gate, the CIPV with its reason, and a reason for each
    other object. ``last_lead`` is the CIPV's id in the frame before.

    An object is in the path when the middle of its nearest face lies between the two edges. The last lead stays in the
    path until it is ``hysteresis_m`` outside, so that a lead at the edge does not flicker."""
    judged, able, failures = [], [], {}
    for item, place in zip(objects, _places(objects, path), strict=True):
        leads = item.id == last_lead
        limit_m = path.half_width_m + (params.hysteresis_m if leads else 0.0)
        checks = [ask(Candidate(item, place, leads, limit_m, params)) for ask in _ELIGIBILITY]
        item = evolve(
            item,
            gates=item.gates + tuple(check.gate for check in checks),
            path_offset_m=place.offset_m if place else None,
            in_path=place is not None and place.within(limit_m),
            in_path_probability=place.probability if place else None,
        )
        judged.append(item)
        failed = next((check.reason for check in checks if not check.gate.passed), None)
        if failed is None:
            able.append(item)
        else:
            failures[item.id] = failed
    nearest = min(able, key=lambda item: (item.distance_m or 0.0, item.id), default=None)
    if nearest is None:
        return tuple(judged), None, tuple(Rejection(k, reason) for k, reason in failures.items())
    lead = _surer(nearest, able)
    failures |= {item.id: _why_after(item, lead) for item in able if item.id != lead.id}
    rejected = tuple(Rejection(item.id, failures[item.id]) for item in judged if item.id != lead.id)
    return tuple(judged), _named(lead, len(able)), rejected


def _surer(nearest: FusedObject, able: list[FusedObject]) -> FusedObject:
    """The nearest candidate, or the surer one that it may be a doubtful view of: one car can have two rows when its box
    and its cluster were not joined, or when it was lost and found again under another number. A row that is carried
    yields to one seen now, one that only the camera has to one the LiDAR measures, when the two distances agree."""
    rank = _surety(nearest)
    same_place = [item for item in able if _surety(item) > rank and _agree(nearest, item)]
    return min(same_place, key=lambda item: (item.distance_m or 0.0, item.id), default=nearest)


def _surety(item: FusedObject) -> int:
    return 0 if item.carried else 1 if item.source == "V" else 2


def _agree(a: FusedObject, b: FusedObject) -> bool:
    """Whether two distances are the same within three standard deviations of both."""
    if a.distance_m is None or b.distance_m is None:
        return False
    sigma = hypot(a.distance_sigma_m or 0.0, b.distance_sigma_m or 0.0)
    return abs(a.distance_m - b.distance_m) <= AGREEMENT_SIGMAS * sigma


def _why_after(item: FusedObject, lead: FusedObject) -> str:
    doubtful = (item.distance_m or 0.0) < (lead.distance_m or 0.0)
    return f"taken for #{lead.id}, which is surer" if doubtful else f"behind #{lead.id}"


class Place(NamedTuple):
    """Where the middle of an object's nearest face is against the path: signed offset from the centre line, positive to
    the left, path length to its foot, and how probably it is in the path."""

    offset_m: float
    ahead_m: float
    probability: float

    def within(self, limit_m: float) -> bool:
        return self.ahead_m > 0.0 and abs(self.offset_m) <= limit_m


def _places(objects: tuple[FusedObject, ...], path: Path) -> list[Place | None]:
    """Each object's place; null where it is not known."""
    faces = [near_face_middle(item.bev) for item in objects if item.bev is not None]
    if not faces:
        return [None] * len(objects)
    offsets, reached = nearest_on_path(path, np.array(faces))
    numbers = (offsets.tolist(), reached.tolist(), _probabilities(offsets, reached, path).tolist())
    known = iter(Place(*row) for row in zip(*numbers, strict=True))
    return [next(known) if item.bev is not None else None for item in objects]


def near_face_middle(bev: tuple[Point2, Point2, Point2, Point2]) -> Point2:
    """The middle of the side that faces the ego origin: between the two nearest corners."""
    (ax, ay), (bx, by) = sorted(bev, key=lambda corner: corner[0] ** 2 + corner[1] ** 2)[:2]
    return (ax + bx) / 2, (ay + by) / 2


def _probabilities(offsets: F64, reached: F64, path: Path) -> F64:
    """(N,) that each true offset lies between the edges, it being normal around the measured one with the path's own
    sigma at that distance, and never surer than a sensor resolves; 0 for what is not ahead."""
    at = [0.0, *(float(s) for s in path.sigma_m)]
    sigma = np.maximum(np.interp(reached, at, [0.0, *path.sigma_m.values()]), SMALLEST_SIGMA_M)
    inside = ndtr((path.half_width_m - offsets) / sigma) - ndtr((-path.half_width_m - offsets) / sigma)
    return np.asarray(np.where(reached > 0.0, inside, 0.0))


# ---------------------------------------------------------------- who may be a lead


def _is_vehicle(who: Candidate) -> Check:
    """A named object must be a vehicle; a nameless one (L) is judged by its size."""
    label = who.item.label
    return Check(Gate("vehicle_class", None, 1.0, label is None or label in VEHICLES), f"class {label}")


def _has_distance(who: Candidate) -> Check:
    distance = who.item.distance_m
    return Check(Gate("distance_known", distance, 0.0, distance is not None), "distance not known")


def _is_confirmed(who: Candidate) -> Check:
    """Two sensors that both see it now are enough at once; one alone must see it again. The lead is confirmed."""
    hits, needed = who.item.hits, 1 if who.item.seen_by == "VL" or who.leads else who.params.confirm_hits
    passed = hits >= needed
    return Check(Gate("hits", hits, needed, passed), "" if passed else f"seen {hits} of {needed} times")


def _is_seen(who: Candidate) -> Check:
    """An object whose distance was not measured in this frame may stay the lead, so that the lead does not flicker; it
    may not become it, because where it is now is only a guess."""
    known = not who.item.carried and who.item.measured
    passed = known or who.leads or who.params.carried_may_become_lead
    reason = "not seen in this frame" if who.item.carried else "its distance was not measured in this frame"
    return Check(Gate("seen", float(known), 0.0 if who.leads else 1.0, passed), reason)


def _is_vehicle_sized(who: Candidate) -> Check:
    """An L object must be as large as a vehicle's rear or side: kerbs, posts and hedges are not leads."""
    item, params = who.item, who.params
    if item.source != "L" or item.cuboid is None:
        return Check(Gate("size", None, params.min_width_m, True), "")
    length, width, height = item.cuboid.size
    across = max(length, width)
    if across < params.min_width_m:
        return Check(Gate("size", across, params.min_width_m, False), f"only {across:.1f} m across")
    if height < params.min_height_m:
        return Check(Gate("size", height, params.min_height_m, False), f"only {height:.1f} m high")
    passed = across <= params.max_size_m
    return Check(
        Gate("size", across, params.max_size_m, passed), "" if passed else f"{across:.0f} m long: not a vehicle"
    )


def _is_in_path(who: Candidate) -> Check:
    if who.place is None:
        return Check(Gate("path_offset", None, who.limit_m, False), "place not known")
    aside = abs(who.place.offset_m)
    reason = f"out of path by {aside - who.limit_m:.1f} m" if aside > who.limit_m else "beside or behind the bumper"
    return Check(Gate("path_offset", aside, who.limit_m, who.place.within(who.limit_m)), reason)


_ELIGIBILITY: tuple[Callable[[Candidate], Check], ...] = (
    _is_vehicle,
    _has_distance,
    _is_confirmed,
    _is_seen,
    _is_vehicle_sized,
    _is_in_path,
)


def _named(lead: FusedObject, candidates: int) -> Cipv:
    closing = closing_speed_mps(lead)
    seen_by = {"V": "camera only", "L": "LiDAR only", "VL": "both sensors"}[lead.source]
    what = f"{lead.label or 'obstacle'} seen by {seen_by}"
    others = f", nearest of {candidates} in path" if candidates > 1 else ", alone in path"
    offset = lead.path_offset_m or 0.0
    side = (
        f"{abs(offset):.1f} m {'left' if offset > 0 else 'right'} of its centre"
        if abs(offset) >= 0.05
        else "on its centre"
    )
    assert lead.distance_m is not None
    return Cipv(lead.id, lead.distance_m, closing, lead.ttc_s, f"{what}{others}, {side}")
