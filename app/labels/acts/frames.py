"""What is said of single frames: the ego path, events, tags."""

from __future__ import annotations

from typing import cast

from app.labels.acts.scope import Scope, by_person, track_of
from app.labels.draft import Draft
from app.labels.refusals import NoSuchLabel
from app.labels.requests import AddEvent, RemovePath, SetPath, Tag
from app.labels.words import frames_text
from pipeline.labels.model import EventLabel, FrameTag, PathLabel


def set_path(draft: Draft, scope: Scope, act: SetPath) -> str:
    scope.check(act.frame)
    left, right = act.lines()
    path = PathLabel(act.frame, left, right, "corrected", by_person(draft))
    number = _path_at(draft, act.frame)
    if number is None:
        draft.add("path", path)
    else:
        draft.put("path", number, path)
    return f"drew the path of {frames_text(act.frame)}"


def remove_path(draft: Draft, scope: Scope, act: RemovePath) -> str:
    number = _path_at(draft, act.frame)
    if number is None:
        raise NoSuchLabel(f"there is no path in {frames_text(act.frame)}")
    draft.put("path", number, None)
    return f"removed the path of {frames_text(act.frame)}"


def add_event(draft: Draft, scope: Scope, act: AddEvent) -> str:
    scope.check(act.frame)
    tracks = tuple(dict.fromkeys(act.tracks))
    for number in tracks:
        track_of(draft, number)
    draft.add("event", EventLabel(act.frame, act.event, tracks, "accepted", by_person(draft)))
    return f"{act.event} in {frames_text(act.frame)}"


def tag(draft: Draft, scope: Scope, act: Tag) -> str:
    scope.check(act.frame)
    there = [
        number
        for number, item in draft.all("tag").items()
        if (cast("FrameTag", item.value).frame, cast("FrameTag", item.value).tag) == (act.frame, act.tag)
    ]
    if act.on and not there:
        draft.add("tag", FrameTag(act.frame, act.tag, by_person(draft)))
    for number in there if not act.on else ():
        draft.put("tag", number, None)
    return f"tagged {frames_text(act.frame)} {act.tag}" if act.on else f"{frames_text(act.frame)} is not {act.tag}"


def _path_at(draft: Draft, frame: int) -> int | None:
    return next((n for n, item in draft.all("path").items() if cast("PathLabel", item.value).frame == frame), None)
