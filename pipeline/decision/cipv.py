"""Chooses the closest in-path vehicle, and gives reasons for it and against every other object (paper, section CIPV).

The rule: of all objects that meet the conditions of a lead (``pipeline.decision.gates``), the nearest. The first
condition that an object fails is the reason given.

Whether an object is in the path is decided over time: each sighting gives log-odds and their running mean decides, so
neither a noisy distance nor one bad box makes the lead flicker. The next lead is predicted as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import exp, log
from typing import NamedTuple

from pipeline.common.fast_replace import evolve
from pipeline.decision.crossing import clears_path_s
from pipeline.decision.cutting_in import cuts_in
from pipeline.decision.gates import Candidate, judge
from pipeline.decision.object_motion import closing_speed_mps
from pipeline.decision.path_position import place
from pipeline.decision.place import SURE, Place
from pipeline.decision.same_car import Rival, surer, surety, the_same
from pipeline.fusion.last_place import LastPlace, is_elsewhere, last_place
from pipeline.params import CipvParams
from pipeline.types import VEHICLES, Cipv, FusedObject, Moment, Path, Rejection, sensors_in_words

_BLUR_M = 0.2
"""Sightings of an object that moves sideways are averaged over at most the time in which it moves this far."""
_HOVERS_MPS = 1.0
"""A lead with this lateral speed is leaving the path, or crossing it: no hysteresis keeps it."""
_DRIVES_S = 1.0
"""What was surely moving for this long has driven: a new side that comes into view moves an object for less."""
_OURS = log(9.0)
"""Log-odds of being in the path, 90 %, with which a vehicle is surely in our lane. One that never was may drive in the
next one, seen from a bend that was not foreseen: a lead by 50 to 60 %, it would be kept for as long as it drives."""
_BOXED_S = 0.5
"""What camera and LiDAR both saw for this long, as a vehicle, is one: a box matches a neighbour's cluster for a few
sweeps at most (``pipeline.fusion.existence``)."""
_HALF_WAY = 0.7
"""A running mean reaches half of a step after 0.7 of its time constant: an object that moves sideways is judged at its
predicted position at that time."""


@dataclass(frozen=True)
class CipvState:
    """State from one frame to the next."""

    lead_id: int | None = None
    """The CIPV."""
    odds: dict[int, float] = field(default_factory=dict)
    """By object id, running mean of the log-odds that the object is in the path."""
    places: dict[int, LastPlace] = field(default_factory=dict)
    """By object id."""
    driving_s: dict[int, float] = field(default_factory=dict)
    """By object id, time for which it was seen to drive."""
    in_lane_s: dict[int, float] = field(default_factory=dict)
    """By object id, time for which it was seen to drive in our lane."""
    boxed_s: dict[int, float] = field(default_factory=dict)
    """By object id, time for which both sensors saw it, the camera as a vehicle."""
    rival: Rival | None = None
    """The object that would lead if it were not probably the same car as the lead; None without one."""


class Choice(NamedTuple):
    """The CIPV and the reasons for the choice."""

    objects: tuple[FusedObject, ...]
    """Every object, with its position relative to the path, its eligibility and its gates."""
    lead: Cipv | None
    """The CIPV with the reason."""
    next_lead: Cipv | None
    """The vehicle that will be the CIPV next."""
    rejected: tuple[Rejection, ...]
    """The reason for each other object."""


class _Judged(NamedTuple):
    """One object after all conditions were checked."""

    item: FusedObject
    """The object with its position relative to the path, its eligibility and its gates."""
    odds: float | None
    """Running mean of its log-odds; None if its position is not known."""
    driving_s: float
    """Time for which it was seen to drive."""
    in_lane_s: float
    """Time for which it was seen to drive in our lane."""
    boxed_s: float
    """Time for which both sensors saw it, the camera as a vehicle."""
    cuts_in: bool
    """Whether it will be in the path soon."""
    why_not: str | None
    """Why it cannot be the lead; None if it can."""


def choose(
    state: CipvState,
    objects: tuple[FusedObject, ...],
    path: Path,
    now: Moment,
    params: CipvParams,
) -> tuple[CipvState, Choice]:
    """The CIPV of this frame, the next one, and a reason for each other object."""
    # Position of each object relative to the path, and which conditions of a lead it meets
    places = place(objects, path, now.ego, params)
    judged = [_judge(state, item, placed, path, now, params) for item, placed in zip(objects, places, strict=True)]
    # The nearest object that meets all conditions is the lead
    able = [each.item for each in judged if each.why_not is None]
    nearest = min(able, key=lambda item: (item.distance_m or 0.0, item.id), default=None)
    lead, rival = None, None
    if nearest is not None:
        lead, rival = the_same(state.lead_id, state.rival, surer(nearest, able), able, params.confirm_hits)
    choice = Choice(
        objects=tuple(each.item for each in judged),
        lead=_named(lead, _why(lead, len(able))) if lead is not None else None,
        next_lead=_next_lead([each.item for each in judged if each.cuts_in], able, lead, params),
        rejected=tuple(_rejections(judged, lead)),
    )
    odds = {each.item.id: each.odds for each in judged if each.odds is not None}
    at = {each.item.id: last_place(each.item) for each in judged}
    driving_s = {each.item.id: each.driving_s for each in judged if each.driving_s > 0.0}
    in_lane_s = {each.item.id: each.in_lane_s for each in judged if each.in_lane_s > 0.0}
    boxed_s = {each.item.id: each.boxed_s for each in judged if each.boxed_s > 0.0}
    return CipvState(lead.id if lead is not None else None, odds, at, driving_s, in_lane_s, boxed_s, rival), choice


def _judge(
    state: CipvState,
    item: FusedObject,
    placed: tuple[Place, float | None] | None,
    path: Path,
    moment: Moment,
    params: CipvParams,
) -> _Judged:
    """Judge one object. placed: its position relative to the path, and when it will cross the edge."""
    where, crossing_s = placed if placed is not None else (None, None)
    moved = is_elsewhere(item, state.places.get(item.id), params.forget_at_takeover)
    leads, widening_m, odds = item.id == state.lead_id and not moved, 0.0, None
    clears_s = clears_path_s(where, item, moment.speed_mps, params)
    if where is not None:
        moving_mps = where.believed_mps
        decide_s = min(params.decide_s, _BLUR_M / max(abs(moving_mps), 1e-3))
        widening_m = _widening_m(leads, moving_mps, params)
        now = where.log_odds(widening_m, moving_mps * decide_s * _HALF_WAY) if clears_s is None else -SURE
        before = now if moved else state.odds.get(item.id, now)
        odds = before + _fresh(moment.dt_s, decide_s) * (now - before)
    driving_s, in_lane_s, boxed_s = (
        0.0 if moved else known.get(item.id, 0.0) for known in (state.driving_s, state.in_lane_s, state.boxed_s)
    )
    if item.surely_moving:
        driving_s += moment.dt_s or 0.0
        if odds is not None and odds >= _OURS:
            in_lane_s += moment.dt_s or 0.0
    if item.seen_by_camera and item.seen_by_lidar and item.label in VEHICLES:
        boxed_s += moment.dt_s or 0.0
    has_driven, was_ours, was_boxed = driving_s >= _DRIVES_S, in_lane_s >= _DRIVES_S, boxed_s >= _BOXED_S
    is_ahead = where is not None and where.ahead_m > 0.0
    probability = 1.0 / (1.0 + exp(-odds)) if is_ahead and odds is not None else 0.0
    verdict = judge(
        Candidate(item, where, odds or 0.0, leads, widening_m, path, params, clears_s, has_driven, was_ours, was_boxed)
    )
    is_in = is_ahead and verdict.eligibility.in_path
    if clears_s is None and where is not None and where.margin_m() >= 0.0 and is_ahead:
        comes_in = where.middle_m * where.believed_mps < 0.0
        if not is_in or (comes_in and not verdict.eligibility.probable):
            crossing_s = 0.0  # it is over the edge, but not yet for long enough to count as in the path
    item = evolve(
        item,
        gates=(*item.gates, *verdict.gates),
        eligibility=verdict.eligibility,
        path_offset_m=where.offset_m if where is not None else None,
        path_margin_m=where.margin_m() if where is not None else None,
        in_path=is_in,
        in_path_probability=probability if where is not None else None,
        lateral_mps=where.sideways_mps if where is not None else None,
        crossing_s=crossing_s,
        clears_path_s=clears_s,
    )
    return _Judged(item, odds, driving_s, in_lane_s, boxed_s, cuts_in(item, where, params), verdict.why_not)


def _rejections(judged: list[_Judged], lead: FusedObject | None) -> Iterator[Rejection]:
    for item, *_, why_not in judged:
        if why_not is not None:
            yield Rejection(item.id, why_not)
        elif lead is not None and item.id != lead.id:
            yield Rejection(item.id, _why_after(item, lead))


def _fresh(dt_s: float | None, decide_s: float) -> float:
    """Weight of a new sighting in the running mean."""
    return 1.0 - exp(-dt_s / decide_s) if dt_s and decide_s > 0.0 else 1.0


def _widening_m(leads: bool, moving_mps: float, params: CipvParams) -> float:
    """How much wider the path is for the previous lead, so that a lead at the edge does not flicker. Less for a lead
    that moves sideways, because it is leaving."""
    return params.hysteresis_m * max(0.0, 1.0 - abs(moving_mps) / _HOVERS_MPS) if leads else 0.0


def _why_after(item: FusedObject, lead: FusedObject) -> str:
    if (item.distance_m or 0.0) >= (lead.distance_m or 0.0):
        return f"behind #{lead.id}"
    better = ", which is better measured" if surety(lead) > surety(item) else ""
    return f"probably the same object as #{lead.id}{better}"


# ---------------------------------------------------------------- next lead


def _next_lead(
    cutting_in: list[FusedObject], able: list[FusedObject], lead: FusedObject | None, params: CipvParams
) -> Cipv | None:
    """The next CIPV: a vehicle nearer than the lead that will enter the path first; otherwise the one behind the
    lead."""
    lead_m = lead.distance_m if lead is not None and lead.distance_m is not None else float("inf")
    nearer = [item for item in cutting_in if (item.distance_m or 0.0) < lead_m]
    if nearer:
        first = min(nearer, key=lambda item: (item.crossing_s or 0.0, item.id))
        return _named(first, f"cutting in: enters the path in {first.crossing_s:.1f} s")
    behind = [item for item in able if lead is not None and item.id != lead.id and (item.distance_m or 0.0) > lead_m]
    if lead is None or not behind:
        return None
    second = min(behind, key=lambda item: (item.distance_m or 0.0, item.id))
    if lead.crossing_s is not None and lead.crossing_s <= params.cut_in_s:
        return _named(second, f"#{lead.id} leaves the path in {lead.crossing_s:.1f} s")
    return _named(second, f"next behind #{lead.id}")


def _why(lead: FusedObject, candidates: int) -> str:
    what = f"{lead.label or 'obstacle'} seen by {sensors_in_words(lead.source)}"
    if lead.distance_from == "returns":
        what += f", ranged by {lead.returns} LiDAR return{'s' if lead.returns > 1 else ''}"
    elif lead.distance_from == "box" and lead.height_from == "road":
        what += ", placed by where it meets the road"
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
