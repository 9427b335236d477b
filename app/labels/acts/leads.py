"""Who the lead is, painted over frames."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from app.labels.acts.scope import Scope, by_person, frames_text, track_of
from app.labels.draft import Draft
from app.labels.refusals import ActRefused
from app.labels.requests import ClearLead, SetLead
from pipeline.labels.model import Lead, LeadRange


def set_lead(draft: Draft, scope: Scope, act: SetLead) -> str:
    scope.check(act.first, act.last)
    if isinstance(act.lead, int):
        track_of(draft, act.lead)
    paint(draft, LeadRange(act.first, act.last, act.lead, "accepted", by_person(draft)))
    return f"lead of {frames_text(act.first, act.last)}: {_named(act.lead)}"


def clear_lead(draft: Draft, scope: Scope, act: ClearLead) -> str:
    scope.check(act.first, act.last)
    if not clear(draft, act.first, act.last):
        raise ActRefused(f"nobody has said who leads in {frames_text(act.first, act.last)}")
    return f"lead of {frames_text(act.first, act.last)}: not said"


def paint(draft: Draft, new: LeadRange) -> None:
    """Over what was there: ranges are cut. One that says the same, by a person too, right before or after is lengthened
    instead."""
    clear(draft, new.first, new.last)
    joined: list[int] = []
    for number, item in draft.all("lead").items():
        old = cast("LeadRange", item.value)
        same = (old.lead, old.state, old.origin.maker, old.origin.name) == (
            new.lead,
            new.state,
            new.origin.maker,
            new.origin.name,
        )
        if same and (old.last + 1 == new.first or old.first == new.last + 1):
            new = replace(new, first=min(old.first, new.first), last=max(old.last, new.last))
            joined.append(number)
    for number in joined[1:]:
        draft.put("lead", number, None)
    if joined:
        draft.put("lead", joined[0], new)
    else:
        draft.add("lead", new)


def clear(draft: Draft, first: int, last: int) -> bool:
    """Cut all ranges out of frames first … last; false when there was none."""
    touched = False
    for number, item in draft.all("lead").items():
        old = cast("LeadRange", item.value)
        if old.last < first or old.first > last:
            continue
        touched = True
        before = replace(old, last=first - 1) if old.first < first else None
        after = replace(old, first=last + 1) if old.last > last else None
        draft.put("lead", number, before or after)
        if before is not None and after is not None:
            draft.add("lead", after)
    return touched


def _named(lead: Lead) -> str:
    return f"#{lead}" if isinstance(lead, int) else {"none": "none", "unknown": "can't tell"}[lead]
