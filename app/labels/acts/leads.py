"""Acts that set the lead over ranges of frames."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from app.labels.acts.overlaps import check_seen
from app.labels.acts.requests import ClearLead, SetLead, TrimLead
from app.labels.acts.scope import Scope, by_person, track_of
from app.labels.errors import ActRefused
from app.labels.store.draft import Draft
from app.labels.store.frame_ranges import free_spans, outside
from app.labels.wording import frames_text, lead_text
from pipeline.labels.model import LeadRange


def set_lead(draft: Draft, scope: Scope, act: SetLead) -> str:
    """Label the lead in a range of frames; this replaces existing labels there."""
    scope.check(act.first, act.last)
    if isinstance(act.lead, int):
        track_of(draft, act.lead)
    check_seen(draft, "lead", act.first, act.last, act)
    paint(draft, LeadRange(act.first, act.last, act.lead, "accepted", by_person(draft)))
    return f"lead of {frames_text(act.first, act.last)}: {lead_text(act.lead)}"


def clear_lead(draft: Draft, scope: Scope, act: ClearLead) -> str:
    """Remove the lead from a range of frames. ActRefused if none is labelled."""
    scope.check(act.first, act.last)
    check_seen(draft, "lead", act.first, act.last, act)
    if not clear(draft, act.first, act.last):
        raise ActRefused(f"no lead is labelled in {frames_text(act.first, act.last)}")
    return f"lead of {frames_text(act.first, act.last)}: cleared"


def trim_lead(draft: Draft, scope: Scope, act: TrimLead) -> str:
    """Ranges that a person set keep their origin; ranges from a pipeline or a file become corrections."""
    scope.check(act.first, act.last)
    old = cast("LeadRange", draft.get("lead", act.range, act.revision).value)
    if old.state == "rejected":
        raise ActRefused("that range is rejected: label the lead there instead")
    for first, last in free_spans(act.first, act.last, range(old.first, old.last + 1)):
        check_seen(draft, "lead", first, last, act)
    if (old.first, old.last) != (act.first, act.last):
        state = old.state if old.origin.maker == "person" else "corrected"
        new = replace(old, first=act.first, last=act.last, state=state, origin=by_person(draft), reviewer="")
        paint(draft, new, act.range)
    return f"lead {lead_text(old.lead)}: {frames_text(old.first, old.last)} → {frames_text(act.first, act.last)}"


def paint(draft: Draft, new: LeadRange, number: int | None = None) -> None:
    """Set a lead range and cut existing ranges that overlap it. An adjacent range with the same lead by the same person
    is extended instead, unless it was reviewed or sent back. number: id of the range to replace, if it exists."""
    clear(draft, new.first, new.last, but=number)
    joined = [number] if number is not None else []
    for other, item in draft.all("lead").items():
        if other == number:
            continue
        old = cast("LeadRange", item.value)
        if _says(old) == _says(new) and (old.last + 1 == new.first or old.first == new.last + 1):
            new = replace(new, first=min(old.first, new.first), last=max(old.last, new.last))
            joined.append(other)
    draft.put_as_one("lead", joined, new)


def clear(draft: Draft, first: int, last: int, *, but: int | None = None) -> bool:
    """Cut frames first … last out of all ranges except ``but``; false if nothing was cut."""
    touched = False
    for number, item in draft.all("lead").items():
        old = cast("LeadRange", item.value)
        if old.last < first or old.first > last or number == but:
            continue
        touched = True
        kept = outside(old, first, last)
        draft.put("lead", number, kept[0] if kept else None)
        for part in kept[1:]:
            draft.add("lead", part)
    return touched


def _says(lead: LeadRange) -> tuple[object, ...]:
    """Properties that must be equal for two ranges to be joined."""
    return lead.lead, lead.state, lead.origin.maker, lead.origin.name, lead.comment, lead.reviewer
