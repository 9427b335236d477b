"""Detects whether an act on frames would overwrite someone else's newer labels, or cut reviewed ones.

An act on a track carries the track's number and the revision it is based on. Ranges of the lead, tags, paths and events
are changed by frame: such an act carries the revision of the labels that the person saw.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

from app.labels.acts.request_fields import OverFrames
from app.labels.errors import Stale
from app.labels.store.draft import Draft
from app.labels.store.values import Item, ItemKind, Value, value_to_json
from app.labels.wording import frames_text, lead_text
from pipeline.labels.model import EventLabel, FrameTag, LeadRange, PathLabel

_Said = dict[int, set[object]]
"""Label values by frame."""


def check_seen(draft: Draft, kind: ItemKind, first: int, last: int, act: OverFrames, word: str | None = None) -> None:
    """Stale if somebody else has changed labels in frames first … last since the revision that the person saw, or if a
    second person has reviewed them and the act does not permit cutting reviewed labels. word: of a tag or event; other
    words are ignored."""
    if act.seen is None:
        return
    for change in draft.changes_of_others(kind, act.seen):
        before = _said(change.before, first, last, word)
        after = _said(change.after, first, last, word)
        others = sorted(frame for frame in {*before, *after} if before.get(frame) != after.get(frame))
        if others:
            where = frames_text(others[0], others[-1])
            _refuse(draft, kind, others[0], f"{change.person} changed the {kind} of {where} since", word)
    if act.over_reviewed:
        return
    for item in draft.all(kind).values():
        if isinstance(item.value, FrameTag) or not item.value.reviewer or not _frames(item.value, first, last, word):
            continue
        raise Stale(
            f"{item.value.reviewer} has reviewed {_called(item)}", kind, item.id, _as_json(item), draft.number - 1
        )


def _refuse(draft: Draft, kind: ItemKind, frame: int, text: str, word: str | None) -> None:
    now = next((item for item in draft.all(kind).values() if _frames(item.value, frame, frame, word)), None)
    raise Stale(text, kind, now.id if now else 0, _as_json(now) if now else None, draft.number - 1)


def _said(values: Iterable[Value], first: int, last: int, word: str | None) -> _Said:
    found: _Said = {}
    for value in values:
        for frame in _frames(value, first, last, word):
            found.setdefault(frame, set()).add(_word(value))
    return found


def _frames(value: Value, first: int, last: int, word: str | None) -> range:
    """The frames in first … last that a label covers; empty for a rejected label, and for another word."""
    own = value.tag if isinstance(value, FrameTag) else value.kind if isinstance(value, EventLabel) else None
    if own != word or (not isinstance(value, FrameTag) and value.state == "rejected"):
        return range(0)
    if isinstance(value, LeadRange | FrameTag):
        return range(max(first, value.first), min(last, value.last) + 1)
    frame = cast("PathLabel | EventLabel", value).frame
    return range(frame, frame + 1) if first <= frame <= last else range(0)


def _word(value: Value) -> object:
    """The value that applies in each of its frames."""
    if isinstance(value, LeadRange):
        return value.lead
    if isinstance(value, PathLabel):
        return value.left, value.right
    return value.tracks if isinstance(value, EventLabel) else True


def _called(item: Item) -> str:
    if isinstance(item.value, LeadRange):
        return f"lead {lead_text(item.value.lead)} in {frames_text(item.value.first, item.value.last)}"
    return f"the {item.kind} of {frames_text(cast('PathLabel | EventLabel', item.value).frame)}"


def _as_json(item: Item) -> dict[str, object]:
    return {"id": item.id, **value_to_json(item.kind, item.value), "revision": item.revision}
