"""The lead over time: when it was acquired, lost and switched, and how soon a vehicle that cuts in was chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from pipeline.common.clips import begins_clip
from pipeline.evaluation.lead_verdict import Judged, nearest_face_m, switches
from pipeline.evaluation.scores.truth import FrameTruth
from pipeline.labels.link_identities import MAX_GAP_S


@dataclass(frozen=True)
class LeadFrame:
    """One frame with a known lead."""

    t_ns: int
    """Its tick."""
    lead: int | None
    """Of the truth; None where there is none."""
    chosen: int | None
    """Id of the CIPV; None where there is none."""
    judged: Judged
    """The verdict on it."""


@dataclass(frozen=True)
class Acquisition:
    """One lead, from the time it becomes the lead."""

    lead: int
    """Id in the truth."""
    t_ns: int
    """When it became the lead."""
    range_m: float | None
    """Its range in the first frame in which it was correctly chosen; None if it never was."""
    after_s: float | None
    """Time until then; None if it never was."""
    from_start: bool
    """Whether it was already the lead at the start of the recording, so that its start is unknown."""
    drop_outs: int
    """How often it was lost again, without any CIPV."""


@dataclass(frozen=True)
class CutIn:
    """A vehicle that cuts in."""

    lead: int
    """Id in the truth."""
    t_ns: int
    """When it becomes the lead."""
    latency_s: float | None
    """Time until it becomes the CIPV; None if it never does."""


def stretches(moments: Sequence[LeadFrame]) -> list[list[LeadFrame]]:
    """The frames of each clip."""
    parts: list[list[LeadFrame]] = []
    for moment in moments:
        if parts and not begins_clip(parts[-1][-1].t_ns, moment.t_ns, MAX_GAP_S):
            parts[-1].append(moment)
        else:
            parts.append([moment])
    return parts


def judged_s(moments: Sequence[LeadFrame]) -> float:
    """Total time in which the lead was judged, without gaps."""
    return sum((part[-1].t_ns - part[0].t_ns) / 1e9 for part in stretches(moments))


def count_switches(moments: Sequence[LeadFrame]) -> int:
    """How often the CIPV's id changed while the lead stayed the same."""
    return sum(switches((m.lead, m.chosen) for m in part) for part in stretches(moments))


def _reigns(moments: Sequence[LeadFrame]) -> list[tuple[list[LeadFrame], bool]]:
    """Each lead's frames from the time it becomes the lead until it no longer is, and whether they start a clip."""
    found: list[tuple[list[LeadFrame], bool]] = []
    for part in stretches(moments):
        last: int | None = None
        for n, moment in enumerate(part):
            if moment.lead is not None and moment.lead == last:
                found[-1][0].append(moment)
            elif moment.lead is not None:
                found.append(([moment], n == 0))
            last = moment.lead
    return found


def acquisitions(moments: Sequence[LeadFrame]) -> list[Acquisition]:
    """One per lead, ordered by time."""
    found = []
    for reign, from_start in _reigns(moments):
        first = next((n for n, m in enumerate(reign) if m.judged.verdict == "correct"), None)
        after = reign[first:] if first is not None else []
        found.append(
            Acquisition(
                lead=reign[0].lead or 0,
                t_ns=reign[0].t_ns,
                range_m=after[0].judged.truth_m if after else None,
                after_s=(after[0].t_ns - reign[0].t_ns) / 1e9 if after else None,
                from_start=from_start,
                drop_outs=sum(a.judged.verdict != "missed" == b.judged.verdict for a, b in pairwise(after)),
            )
        )
    return found


def cut_ins(
    moments: Sequence[LeadFrame], truth: Mapping[int, FrameTruth], labelled: Sequence[tuple[int, int]] | None
) -> list[CutIn]:
    """``labelled``: tick and object of each cut-in labelled by people. Without them: each lead that in the previous
    frame was labelled outside the lane and nearer than that frame's lead."""
    reigns = [reign for reign, _ in _reigns(moments)]
    if labelled is not None:
        return [cut_in for tick, lead in labelled if (cut_in := _labelled(reigns, tick, lead)) is not None]
    before = {b.t_ns: a for part in stretches(moments) for a, b in pairwise(part)}
    found = []
    for reign in reigns:
        start = reign[0]
        if start.t_ns in before and _cuts_in(start, truth[before[start.t_ns].t_ns]):
            found.append(CutIn(start.lead or 0, start.t_ns, _latency_s(reign, start.t_ns)))
    return found


def _labelled(reigns: Sequence[Sequence[LeadFrame]], tick: int, lead: int) -> CutIn | None:
    """For a labelled event: the next episode in which the vehicle is the lead, or the one that contains the event. None
    if the lead is not known then."""
    reign = next((each for each in reigns if each[0].lead == lead and each[-1].t_ns >= tick), None)
    if reign is None:
        return None
    return CutIn(lead, tick, _latency_s(reign, max(tick, reign[0].t_ns)))


def _cuts_in(start: LeadFrame, earlier: FrameTruth) -> bool:
    item = next((each for each in earlier.objects if each.id == start.lead), None)
    if item is None or not earlier.lead_known or earlier.lead_box is not None:
        return False
    return earlier.lead is None or (earlier.lead.id != item.id and nearest_face_m(item) < nearest_face_m(earlier.lead))


def _latency_s(reign: Sequence[LeadFrame], since_ns: int) -> float | None:
    right = next((m.t_ns for m in reign if m.t_ns >= since_ns and m.judged.verdict == "correct"), None)
    return (right - since_ns) / 1e9 if right is not None else None
