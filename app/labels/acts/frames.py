"""Acts on single frames: the ego path and events."""

from __future__ import annotations

from typing import cast

from app.labels.acts.overlaps import check_seen
from app.labels.acts.requests import AddEvent, RemovePath, SetPath
from app.labels.acts.scope import Scope, by_person, track_of
from app.labels.errors import NoSuchLabel
from app.labels.store.draft import Draft
from app.labels.wording import frames_text
from pipeline.labels.model import EventLabel, PathLabel


def set_path(draft: Draft, scope: Scope, act: SetPath) -> str:
    """Set or replace the ego path of a frame."""
    scope.check(act.frame)
    left, right = act.lines()
    check_seen(draft, "path", act.frame, act.frame, act)
    path = PathLabel(act.frame, left, right, "corrected", by_person(draft))
    number = _path_at(draft, act.frame)
    if number is None:
        draft.add("path", path)
    else:
        draft.put("path", number, path)
    return f"drew the path in {frames_text(act.frame)}"


def remove_path(draft: Draft, scope: Scope, act: RemovePath) -> str:
    """Remove the ego path of a frame. NoSuchLabel if it has none."""
    check_seen(draft, "path", act.frame, act.frame, act)
    number = _path_at(draft, act.frame)
    if number is None:
        raise NoSuchLabel(f"no path in {frames_text(act.frame)}")
    draft.put("path", number, None)
    return f"removed the path in {frames_text(act.frame)}"


def add_event(draft: Draft, scope: Scope, act: AddEvent) -> str:
    """Add an event to a frame, with the tracks involved."""
    scope.check(act.frame)
    tracks = tuple(dict.fromkeys(act.tracks))
    for number in tracks:
        track_of(draft, number)
    check_seen(draft, "event", act.frame, act.frame, act, act.event)
    draft.add("event", EventLabel(act.frame, act.event, tracks, "accepted", by_person(draft)))
    of = f" of {', '.join(f'#{number}' for number in tracks)}" if tracks else ""
    return f"{act.event.replace('_', '-')}{of} in {frames_text(act.frame)}"


def _path_at(draft: Draft, frame: int) -> int | None:
    return next((n for n, item in draft.all("path").items() if cast("PathLabel", item.value).frame == frame), None)
