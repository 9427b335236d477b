"""Acts that accept or reject labels, or send them back for another review."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from app.labels.acts.requests import Accept, Reject, Remove, ReviewOk, SendBack
from app.labels.acts.scope import Scope, Stated, stated, track_of
from app.labels.errors import ActRefused
from app.labels.store.draft import Draft
from app.labels.store.values import Value
from app.labels.wording import frames_text, lead_text
from pipeline.labels.model import EventLabel, FrameTag, LabelTrack, LeadRange, PathLabel


def accept(draft: Draft, scope: Scope, act: Accept) -> str:
    """A correction by a person stays a correction. The label keeps its author; the log records who accepted it."""
    done = []
    for ref in act.items:
        value = _answered(stated(draft.get(ref.kind, ref.id, ref.revision)))
        draft.put(ref.kind, ref.id, value if value.state == "corrected" else replace(value, state="accepted"))
        done.append(value)
    return f"accepted {_names(done)}{_still_proposed(draft, done)}"


def reject(draft: Draft, scope: Scope, act: Reject) -> str:
    """Mark items as wrong; they stay in the store and do not count."""
    done = []
    for ref in act.items:
        value = _answered(stated(draft.get(ref.kind, ref.id, ref.revision)))
        draft.put(ref.kind, ref.id, replace(value, state="rejected", reviewer=""))
        done.append(value)
    return f"rejected {_names(done)}"


def review_ok(draft: Draft, scope: Scope, act: ReviewOk) -> str:
    """Approval by a second person: a label's author (``read_authors``) cannot review it."""
    done = []
    for ref in act.items:
        item = draft.get(ref.kind, ref.id, ref.revision)
        value = stated(item)
        if value.reviewer == draft.person:
            raise ActRefused(f"you have already reviewed {_name(value)}")
        if draft.person == draft.author_of(item):
            raise ActRefused(f"{_name(value)} is your own: a second person must review it")
        draft.put(ref.kind, ref.id, replace(_answered(value), state="accepted", reviewer=draft.person))
        done.append(value)
    return f"reviewed and accepted {_names(done)}"


def send_back(draft: Draft, scope: Scope, act: SendBack) -> str:
    """Make items proposals again, with a comment for whoever works on them next."""
    done = []
    for ref in act.items:
        value = stated(draft.get(ref.kind, ref.id, ref.revision))
        draft.put(ref.kind, ref.id, replace(value, state="proposed", comment=act.comment, reviewer=""))
        done.append(value)
    return f"sent back {_names(done)}: {act.comment}"


def remove(draft: Draft, scope: Scope, act: Remove) -> str:
    """Lead ranges and events that refer to a removed track are removed as well."""
    done = []
    for ref in act.items:
        done.append(draft.get(ref.kind, ref.id, ref.revision).value)
        draft.put(ref.kind, ref.id, None)
    gone = {ref.id for ref in act.items if ref.kind == "track"}
    if gone:
        forget_tracks(draft, gone)
    return f"removed {_names(done)}"


def forget_tracks(draft: Draft, gone: set[int]) -> None:
    """Remove deleted tracks from ranges and events."""
    for number, item in draft.all("lead").items():
        if cast("LeadRange", item.value).lead in gone:
            draft.put("lead", number, None)
    for number, item in draft.all("event").items():
        event = cast("EventLabel", item.value)
        left = tuple(track for track in event.tracks if track not in gone)
        draft.put("event", number, replace(event, tracks=left))


def _still_proposed(draft: Draft, done: Sequence[Value]) -> str:
    """A note about tracks that lead in an accepted range but have not been accepted themselves: such a lead is not
    scored yet."""
    leads = sorted({each.lead for each in done if isinstance(each, LeadRange) and isinstance(each.lead, int)})
    left = [f"#{lead}" for lead in leads if track_of(draft, lead).state == "proposed"]
    return f"; {', '.join(left)} {'is' if len(left) == 1 else 'are'} still proposed" if left else ""


def _answered(value: Stated) -> Stated:
    """The label without a reviewer's comment, because it has been handled."""
    return replace(value, comment="")


def _names(values: Sequence[Value]) -> str:
    named = ", ".join(_name(value) for value in values[:3])
    return named + (f" and {len(values) - 3} more" if len(values) > 3 else "")


def _name(value: Value) -> str:
    """Display name: lead ranges have no number that users know."""
    if isinstance(value, LabelTrack):
        return f"#{value.id}"
    if isinstance(value, FrameTag):
        return f"{value.tag} of {frames_text(value.first, value.last)}"
    if isinstance(value, LeadRange):
        return f"lead {lead_text(value.lead)} in {frames_text(value.first, value.last)}"
    if isinstance(value, PathLabel):
        return f"the path of {frames_text(value.frame)}"
    return f"{value.kind.replace('_', '-')} in {frames_text(value.frame)}"
