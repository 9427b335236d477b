"""Saying of labels that they are so, are not so, or are to be looked at again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from app.labels.acts.scope import Scope, Stated, stated, track_of
from app.labels.draft import Draft, name_of
from app.labels.refusals import ActRefused, BadAct
from app.labels.requests import Accept, Ref, Reject, Remove, ReviewOk, SendBack
from pipeline.labels.model import EventLabel, LabelTrack, LeadRange


def accept(draft: Draft, scope: Scope, act: Accept) -> str:
    """What a person corrected stays a correction. Who made a label does not change: the log knows who accepted it."""
    for ref in act.items:
        value = _answered(stated(draft.get(ref.kind, ref.id, ref.revision)))
        draft.put(ref.kind, ref.id, value if value.state == "corrected" else replace(value, state="accepted"))
    return f"accepted {_names(act.items)}"


def reject(draft: Draft, scope: Scope, act: Reject) -> str:
    for ref in act.items:
        value = stated(draft.get(ref.kind, ref.id, ref.revision))
        draft.put(ref.kind, ref.id, replace(_answered(value), state="rejected"))
    return f"rejected {_names(act.items)}"


def review_ok(draft: Draft, scope: Scope, act: ReviewOk) -> str:
    """By a second person: who made a label as it is, or changed it last, does not review it."""
    for ref in act.items:
        value = stated(draft.get(ref.kind, ref.id, ref.revision))
        made = value.origin.name if value.origin.maker == "person" else None
        if draft.person in (made, draft.changed_by(ref.kind, ref.id)):
            raise ActRefused(f"you changed {name_of(ref.kind, ref.id)} last: a second person reviews it")
        draft.put(ref.kind, ref.id, replace(_answered(value), state="accepted"))
    return f"reviewed and accepted {_names(act.items)}"


def send_back(draft: Draft, scope: Scope, act: SendBack) -> str:
    for ref in act.items:
        if ref.kind != "track":
            raise BadAct("tracks are sent back; what else is wrong is put right, or rejected")
        track = track_of(draft, ref.id, ref.revision)
        draft.put("track", ref.id, replace(track, state="proposed", comment=act.comment))
    return f"sent back {_names(act.items)}: {act.comment}"


def remove(draft: Draft, scope: Scope, act: Remove) -> str:
    """What names a removed track as the lead, or in an event, goes with it: it would name nothing."""
    for ref in act.items:
        draft.get(ref.kind, ref.id, ref.revision)
        draft.put(ref.kind, ref.id, None)
    gone = {ref.id for ref in act.items if ref.kind == "track"}
    if gone:
        forget_tracks(draft, gone)
    return f"removed {_names(act.items)}"


def forget_tracks(draft: Draft, gone: set[int]) -> None:
    """Take tracks that are no more out of ranges and events."""
    for number, item in draft.all("lead").items():
        if cast("LeadRange", item.value).lead in gone:
            draft.put("lead", number, None)
    for number, item in draft.all("event").items():
        event = cast("EventLabel", item.value)
        left = tuple(track for track in event.tracks if track not in gone)
        draft.put("event", number, replace(event, tracks=left))


def _answered(value: Stated) -> Stated:
    """Without what a reviewer asked for: it has been looked at."""
    return replace(value, comment="") if isinstance(value, LabelTrack) else value


def _names(items: Sequence[Ref]) -> str:
    named = ", ".join(name_of(ref.kind, ref.id) for ref in items[:3])
    return named + (f" and {len(items) - 3} more" if len(items) > 3 else "")
