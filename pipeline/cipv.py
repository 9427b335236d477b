"""Which vehicle ahead is the closest one in the path, why this one, and why not each other (paper, section CIPV).

The rule, in one place: among the objects that may be a lead at all (``_ELIGIBILITY``), the one in the path with the
smallest distance. Each test leaves its number and limit on the object; the first that fails is the reason given.

Being in the path is decided over time: every sighting gives log-odds, a running mean of them decides, so that neither a
swaying distance nor one bad box makes the lead flicker. Which one will be next is said as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import copysign, exp, hypot, sqrt
from typing import NamedTuple

from pipeline.motion import closing_speed_mps
from pipeline.params import CipvParams
from pipeline.path.placing import Place, believed_mps, place
from pipeline.records import evolve
from pipeline.types import VEHICLES, Cipv, EgoState, FusedObject, Gate, Path, Rejection

AGREEMENT_SIGMAS = 3.0
_BLUR_M = 0.2
"""What moves sideways is weighed over no longer than it takes to move this far: older sightings were elsewhere."""
_HOVERS_MPS = 1.0
_KNOWN_M = 0.5
"""A tracked distance that is as sure as this is as good as a measured one."""
_HALF_WAY = 0.7
"""A running mean has turned half way after 0.7 of its time: what moves sideways is judged where it will be by then."""
ON_A_VAGUE_PATH = 0.25
"""What is left of the permitted uncertainty on a path that is not usable: a metre, as a guess has."""
STAYS_UP_TO = 1.5
"""The lead stays it while its place against the path is this much more uncertain than a new one's may be."""


@dataclass(frozen=True)
class CipvState:
    """What one frame leaves to the next. lead_id: the CIPV. odds: of each object, the running mean of its log-odds."""

    lead_id: int | None = None
    odds: dict[int, float] = field(default_factory=dict)


class Candidate(NamedTuple):
    """An object with what its tests need to know: its place against the path, the running log-odds of being in it,
    whether these put it in, whether it led in the frame before, by how much the path is wider for it, and the path."""

    item: FusedObject
    place: Place | None
    odds: float
    inside: bool
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


class Test(NamedTuple):
    """One question to a candidate: the gate with its number and limit, and the sentence that says why it failed, which
    is only made for the one failure of an object that is given as its reason."""

    ask: Callable[[Candidate], Gate]
    why_not: Callable[[Candidate], str]


class Choice(NamedTuple):
    """objects: with their place against the path and every gate. lead: the CIPV with its reason. next_lead: who will be
    it next. rejected: a reason for each other object."""

    objects: tuple[FusedObject, ...]
    lead: Cipv | None
    next_lead: Cipv | None
    rejected: tuple[Rejection, ...]


def choose(
    state: CipvState,
    objects: tuple[FusedObject, ...],
    path: Path,
    ego: EgoState | None,
    dt_s: float | None,
    params: CipvParams,
) -> tuple[CipvState, Choice]:
    """The CIPV of this frame, the next one, and a reason for each other object."""
    judged, able, failures, odds = [], [], {}, {}
    for item, placed in zip(objects, place(objects, path, ego, params), strict=True):
        where, crossing_s = placed if placed is not None else (None, None)
        leads, widening_m = item.id == state.lead_id, 0.0
        if where is not None:
            moving_mps = believed_mps(where.sideways_mps, item)
            decide_s = min(params.decide_s, _BLUR_M / max(abs(moving_mps), 1e-3))
            widening_m = _widening_m(leads, moving_mps, params)
            now = where.log_odds(widening_m, moving_mps * decide_s * _HALF_WAY)
            before = state.odds.get(item.id, now)
            odds[item.id] = before + _fresh(dt_s, decide_s) * (now - before)
        now_in = where is not None and where.ahead_m > 0.0 and odds[item.id] > 0.0
        candidate = Candidate(item, where, odds.get(item.id, 0.0), now_in, leads, widening_m, path, params)
        if where is not None and where.margin_m() >= 0.0 and where.ahead_m > 0.0 and not now_in:
            crossing_s = 0.0  # it is over the edge, though not for long enough to be called in the path
        gates = [ask(candidate) for ask in _QUESTIONS]
        item = evolve(
            item,
            gates=(*item.gates, *gates),
            path_offset_m=where.offset_m if where is not None else None,
            in_path=now_in,
            in_path_probability=where.probability() if where is not None else None,
            lateral_mps=where.sideways_mps if where is not None else None,
            crossing_s=crossing_s,
        )
        judged.append(item)
        failed = next((k for k, gate in enumerate(gates) if not gate.passed), None)
        if failed is None:
            able.append(item)
        else:
            failures[item.id] = _ELIGIBILITY[failed].why_not(candidate)
    nearest = min(able, key=lambda item: (item.distance_m or 0.0, item.id), default=None)
    lead = _surer(nearest, able) if nearest is not None else None
    if lead is not None:
        failures |= {item.id: _why_after(item, lead) for item in able if item.id != lead.id}
    rejected = tuple(Rejection(item.id, failures[item.id]) for item in judged if item.id in failures)
    named = _named(lead, _why(lead, len(able))) if lead is not None else None
    choice = Choice(tuple(judged), named, _next_lead(judged, able, lead, params), rejected)
    return CipvState(lead.id if lead is not None else None, odds), choice


def _fresh(dt_s: float | None, decide_s: float) -> float:
    """The share that a new sighting has in the running mean."""
    return 1.0 - exp(-dt_s / decide_s) if dt_s and decide_s > 0.0 else 1.0


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


# ---------------------------------------------------------------- who will be next


def _next_lead(
    judged: list[FusedObject], able: list[FusedObject], lead: FusedObject | None, params: CipvParams
) -> Cipv | None:
    """The next-to-be CIPV: the vehicle that will be first over the edge of the path, nearer than the lead; else the one
    behind a lead that leaves, or simply behind it."""
    lead_m = lead.distance_m if lead is not None and lead.distance_m is not None else float("inf")
    cutting_in = [
        item
        for item in judged
        if not item.in_path
        and item.crossing_s is not None
        and item.crossing_s <= params.cut_in_s
        and (item.distance_m or 0.0) < lead_m
        and not item.carried
        and all(gate.passed for gate in item.gates if gate.name in _BESIDE_PLACE)
    ]
    if cutting_in:
        first = min(cutting_in, key=lambda item: (item.crossing_s or 0.0, item.id))
        return _named(first, f"cuts in: over the edge of the path in {first.crossing_s:.1f} s")
    behind = [item for item in able if lead is not None and item.id != lead.id and (item.distance_m or 0.0) > lead_m]
    if lead is None or not behind:
        return None
    second = min(behind, key=lambda item: (item.distance_m or 0.0, item.id))
    if lead.crossing_s is not None and lead.crossing_s <= params.cut_in_s:
        return _named(second, f"#{lead.id} leaves the path in {lead.crossing_s:.1f} s")
    return _named(second, f"next behind #{lead.id}")


# ---------------------------------------------------------------- who may be a lead


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


def _path_offset(who: Candidate) -> Gate:
    """In metres, what the odds say: see ``aside_m``."""
    if who.place is None:
        return Gate("path_offset", None, who.path.half_width_m, False)
    return Gate("path_offset", who.aside_m, who.place.limit_m + who.widening_m, who.inside)


def _out_of_path(who: Candidate) -> str:
    if who.place is None:
        return "place not known"
    if who.place.ahead_m <= 0.0:
        return "beside or behind the bumper"
    outside_m = -who.place.margin_m(who.widening_m)
    return f"out of path by {outside_m:.1f} m" if outside_m > 0.0 else "in path for a moment only"


def _widening_m(leads: bool, moving_mps: float, params: CipvParams) -> float:
    """The last lead leaves the path only this far outside it, so that a lead at the edge does not flicker. One that
    moves sideways is on its way."""
    return params.hysteresis_m * max(0.0, 1.0 - abs(moving_mps) / _HOVERS_MPS) if leads else 0.0


def _path_odds(who: Candidate) -> Gate:
    """By the running mean of what the sightings say."""
    return Gate("path_odds", who.odds, 0.0, who.inside)


def _path_sigma(who: Candidate) -> Gate:
    """So far ahead that its place against the path is uncertain by more than a lane, nobody can be said to be in it.
    On a path that is too vague to be driven after, only what lies where it is known well may lead."""
    limit = who.params.max_sigma_m * (STAYS_UP_TO if who.leads else 1.0)
    limit *= 1.0 if who.path.usable else ON_A_VAGUE_PATH
    sigma = who.place.sigma_m if who.place is not None else 0.0
    return Gate("path_sigma", sigma, limit, sigma <= limit)


def _uncertain(who: Candidate) -> str:
    return f"its place against the path is uncertain by {who.place.sigma_m if who.place is not None else 0.0:.1f} m"


_ELIGIBILITY = (
    Test(_vehicle_class, lambda who: f"class {who.item.label}"),
    Test(_distance_known, lambda _: "distance not known"),
    Test(_hits, lambda who: f"seen {who.item.hits} of {who.params.confirm_hits} times"),
    Test(_seen, _not_seen),
    Test(_size, _wrong_size),
    Test(_path_offset, _out_of_path),
    Test(_path_odds, _out_of_path),
    Test(_path_sigma, _uncertain),
)
_QUESTIONS = tuple(test.ask for test in _ELIGIBILITY)
_BESIDE_PLACE = frozenset({"vehicle_class", "distance_known", "hits", "size"})
"""The gates that one which is not in the path yet must pass all the same."""


def _why(lead: FusedObject, candidates: int) -> str:
    seen_by = {"V": "camera only", "L": "LiDAR only", "VL": "both sensors"}[lead.source]
    what = f"{lead.label or 'obstacle'} seen by {seen_by}"
    others = f", nearest of {candidates} in path" if candidates > 1 else ", alone in path"
    offset = lead.path_offset_m or 0.0
    side = (
        f"{abs(offset):.1f} m {'left' if offset > 0 else 'right'} of its centre"
        if abs(offset) >= 0.05
        else "on its centre"
    )
    return f"{what}{others}, {side}"


def _named(item: FusedObject, reason: str) -> Cipv:
    assert item.distance_m is not None
    return Cipv(item.id, item.distance_m, closing_speed_mps(item), item.ttc_s, reason)
