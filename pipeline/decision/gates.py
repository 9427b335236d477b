"""Who may be a lead at all: the questions, in the order in which the first failure is the reason given:
what it is, where it is, and only then how well it is known: nobody waits for the third sighting of what is aside."""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, sqrt
from typing import NamedTuple

from pipeline.decision.path_position import Place
from pipeline.params import CipvParams
from pipeline.types import VEHICLES, FusedObject, Gate, Path

_KNOWN_M = 0.5
"""A tracked distance that is as sure as this is as good as a measured one."""
ON_A_VAGUE_PATH = 0.25
"""What is left of the permitted uncertainty on a path that is not usable: a metre, as a guess has."""
STAYS_UP_TO = 1.5
"""The lead stays it while its place against the path is this much more uncertain than a new one's may be."""


class Candidate(NamedTuple):
    """An object with what its tests need to know: its place against the path, the running log-odds of being in it,
    whether it led in the frame before, by how much the path is wider for it, and the path."""

    item: FusedObject
    place: Place | None
    odds: float
    leads: bool
    widening_m: float
    path: Path
    params: CipvParams

    @property
    def aside_m(self) -> float:
        """How far beside the middle of the path it is, as ``path_offset`` is asked: as measured now, unless its
        sightings so far say otherwise; then what they stand for."""
        assert self.place is not None
        margin_m = self.place.margin_m(self.widening_m)
        if (margin_m >= 0.0) == (self.odds > 0.0):
            return abs(self.place.middle_m)
        so_far_m = copysign(self.place.sigma_m * sqrt(2.0 * abs(self.odds)), self.odds)
        return self.place.limit_m + self.widening_m - so_far_m


class Question(NamedTuple):
    """One test of a candidate: the gate with its number and limit, and the sentence that says why it failed, which
    is only made for the one failure of an object that is given as its reason."""

    ask: Callable[[Candidate], Gate]
    why_not: Callable[[Candidate], str]


def _vehicle_class(who: Candidate) -> Gate:
    """A named object must be a vehicle; a nameless one (L) is judged by its size."""
    label = who.item.label
    return Gate("vehicle_class", None, 1.0, label is None or label in VEHICLES)


def _distance_known(who: Candidate) -> Gate:
    distance_m = who.item.distance_m
    return Gate("distance_known", distance_m, 0.0, distance_m is not None)


def _hits(who: Candidate) -> Gate:
    """Two sensors that both see it now are enough at once; one alone must see it again. The lead is confirmed."""
    hits, needed = who.item.hits, 1 if who.item.seen_by == "VL" or who.leads else who.params.confirm_hits
    return Gate("hits", hits, needed, hits >= needed)


def _seen(who: Candidate) -> Gate:
    """An object whose distance was not measured in this frame may stay the lead, so that the lead does not flicker; it
    may not become it, because where it is now is only a guess. One that the camera sees and the LiDAR has just lost is
    still known."""
    item = who.item
    followed = item.seen_by == "V" and item.source == "VL" and (item.distance_sigma_m or 0.0) < _KNOWN_M
    known = bool(item.seen_by) and (item.measured or followed)
    passed = known or who.leads or who.params.carried_may_become_lead
    return Gate("seen", float(known), 0.0 if who.leads else 1.0, passed)


def _not_seen(who: Candidate) -> str:
    return "not seen in this frame" if who.item.carried else "its distance was not measured in this frame"


def _size(who: Candidate) -> Gate:
    """An L object must be as large as a vehicle's rear or side: kerbs, posts and hedges are not leads."""
    item, params = who.item, who.params
    if item.source != "L" or item.cuboid is None:
        return Gate("size", None, params.min_width_m, True)
    length, width, height = item.cuboid.size
    across = length if length > width else width
    if across < params.min_width_m:
        return Gate("size", across, params.min_width_m, False)
    if height < params.min_height_m:
        return Gate("size", height, params.min_height_m, False)
    return Gate("size", across, params.max_size_m, across <= params.max_size_m)


def _wrong_size(who: Candidate) -> str:
    length, width, height = who.item.cuboid.size if who.item.cuboid is not None else (0.0, 0.0, 0.0)
    across = max(length, width)
    if across < who.params.min_width_m:
        return f"only {across:.1f} m across"
    if height < who.params.min_height_m:
        return f"only {height:.1f} m high"
    return f"{across:.0f} m long: not a vehicle"


def _ahead(who: Candidate) -> Gate:
    """By the way along the path to it, from the bumper."""
    ahead_m = who.place.ahead_m if who.place is not None else None
    return Gate("ahead", ahead_m, 0.0, ahead_m is not None and ahead_m > 0.0)


def _path_offset(who: Candidate) -> Gate:
    """In metres, what the running mean of the log-odds says: see ``aside_m``."""
    if who.place is None:
        return Gate("path_offset", None, who.path.half_width_m, False)
    return Gate("path_offset", who.aside_m, who.place.limit_m + who.widening_m, who.odds > 0.0)


def _out_of_path(who: Candidate) -> str:
    if who.place is None:
        return "place not known"
    outside_m = -who.place.margin_m(who.widening_m)
    return f"out of path by {outside_m:.1f} m" if outside_m > 0.0 else "in path for a moment only"


def _path_sigma(who: Candidate) -> Gate:
    """So far ahead that its place against the path is uncertain by more than a lane, nobody can be said to be in it.
    On a path that is too vague to be driven after, only what lies where it is known well may lead."""
    limit = who.params.max_sigma_m * (STAYS_UP_TO if who.leads else 1.0)
    limit *= 1.0 if who.path.usable else ON_A_VAGUE_PATH
    sigma = who.place.sigma_m if who.place is not None else 0.0
    return Gate("path_sigma", sigma, limit, sigma <= limit)


def _uncertain(who: Candidate) -> str:
    return f"its place against the path is uncertain by {who.place.sigma_m if who.place is not None else 0.0:.1f} m"


QUESTIONS = (
    Question(_vehicle_class, lambda who: f"class {who.item.label}"),
    Question(_distance_known, lambda _: "distance not known"),
    Question(_size, _wrong_size),
    Question(_ahead, lambda who: "place not known" if who.place is None else "beside or behind the bumper"),
    Question(_path_offset, _out_of_path),
    Question(_hits, lambda who: f"seen {who.item.hits} of {who.params.confirm_hits} times"),
    Question(_seen, _not_seen),
    Question(_path_sigma, _uncertain),
)
BESIDE_PLACE = frozenset({"vehicle_class", "distance_known", "hits", "size"})
"""The gates that one which is not in the path yet must pass all the same."""
