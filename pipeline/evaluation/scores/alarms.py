"""Compares warnings and braking with when the labels say that they are due.

They are due when the true lead's range and closing speed exceed the emergency brake's own limits. Only drives with
known ego speed are scored.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot, inf
from typing import Literal

from pipeline.common.clips import first_frames
from pipeline.common.geometry import closest_on_polygon
from pipeline.decision.object_motion import SMALLEST_CLOSING_MPS, required_decel_mps2
from pipeline.evaluation.lead_verdict import nearest_face_m
from pipeline.evaluation.scores.truth import FrameTruth
from pipeline.labels.link_identities import MAX_GAP_S
from pipeline.params import AebParams
from pipeline.types import AccCommand, Result

AlarmKind = Literal["warning", "braking"]
_ACTING: dict[AlarmKind, frozenset[str]] = {
    "warning": frozenset({"warn", "partial_brake", "full_brake"}),
    "braking": frozenset({"partial_brake", "full_brake"}),
}


@dataclass(frozen=True)
class Alarm:
    """One dangerous moment, or one false alarm."""

    kind: AlarmKind
    """Warning or braking."""
    due_ns: int | None
    """When it was due according to the labels; None for a false alarm."""
    acted_ns: int | None
    """When the pipeline acted; None if it did not."""
    true_ttc_s: float | None
    """TTC of the true lead when the pipeline acted; None without one."""

    @property
    def delay_s(self) -> float | None:
        """Seconds from the due time until the pipeline acted; None for a missed or a false alarm."""
        if self.due_ns is None or self.acted_ns is None:
            return None
        return (self.acted_ns - self.due_ns) / 1e9

    @property
    def t_ns(self) -> int:
        """The time at which to show it."""
        return (self.due_ns if self.due_ns is not None else self.acted_ns) or 0


@dataclass(frozen=True)
class _Moment:
    t_ns: int
    ttc_s: float
    needed_mps2: float
    acc: AccCommand


def alarms(frames: Sequence[tuple[Result, FrameTruth]], params: AebParams) -> list[Alarm]:
    """Every warning and braking that was due or given, in frames in which the lead and its position are known. Empty
    without ego speed."""
    moments = [
        _Moment(truth.t_ns, *_danger(truth, params), result.acc)
        for result, truth in frames
        if result.acc is not None and truth.lead_known and truth.lead_box is None
    ]
    warn_due = _due(params.warn_ttc_s, inf)
    brake_due = _due(params.partial_ttc_s, params.partial_when_mps2)
    return [*_of_kind("warning", moments, warn_due), *_of_kind("braking", moments, brake_due)]


def _danger(truth: FrameTruth, params: AebParams) -> tuple[float, float]:
    """The true lead's TTC in s and the required deceleration; infinity and 0 if it does not come nearer."""
    lead = truth.lead
    velocity = (truth.velocity_mps or {}).get(lead.id) if lead is not None and lead.id is not None else None
    if lead is None or velocity is None:
        return inf, 0.0
    x, y = closest_on_polygon(lead.cuboid.footprint())
    range_m = nearest_face_m(lead)
    closing = -(x * velocity[0] + y * velocity[1]) / max(hypot(x, y), 1e-6)
    if closing < SMALLEST_CLOSING_MPS:
        return inf, 0.0
    return range_m / closing, required_decel_mps2(range_m, closing, params)


def _due(ttc_s: float, needed_mps2: float) -> Callable[[_Moment], bool]:
    return lambda moment: moment.ttc_s < ttc_s or moment.needed_mps2 > needed_mps2


def _of_kind(kind: AlarmKind, moments: Sequence[_Moment], is_due: Callable[[_Moment], bool]) -> list[Alarm]:
    """Each dangerous period with the first alarm that overlaps it, then the alarms without overlap."""
    dangers = _runs(moments, is_due)
    acts = _runs(moments, lambda moment: moment.acc.state in _ACTING[kind])
    found, used = [], set()
    for first, last in dangers:
        hits = [n for n, (start, end) in enumerate(acts) if start <= last and end >= first]
        used.update(hits)
        acted = moments[acts[hits[0]][0]] if hits else None
        found.append(_alarm(kind, moments[first].t_ns, acted))
    found += [_alarm(kind, None, moments[start]) for n, (start, _) in enumerate(acts) if n not in used]
    return sorted(found, key=lambda alarm: alarm.t_ns)


def _alarm(kind: AlarmKind, due_ns: int | None, acted: _Moment | None) -> Alarm:
    if acted is None:
        return Alarm(kind, due_ns, None, None)
    return Alarm(kind, due_ns, acted.t_ns, acted.ttc_s if acted.ttc_s < inf else None)


def _runs(moments: Sequence[_Moment], holds: Callable[[_Moment], bool]) -> list[tuple[int, int]]:
    """First and last of each run of moments that meet the condition, interrupted by gaps."""
    broken = set(first_frames([moment.t_ns for moment in moments], MAX_GAP_S))
    runs: list[tuple[int, int]] = []
    for n, moment in enumerate(moments):
        if not holds(moment):
            continue
        if runs and runs[-1][1] == n - 1 and n not in broken:
            runs[-1] = (runs[-1][0], n)
        else:
            runs.append((n, n))
    return runs
