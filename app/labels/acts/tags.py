"""Acts that set tags on ranges of frames."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from app.labels.acts.overlaps import check_seen
from app.labels.acts.requests import Tag
from app.labels.acts.scope import Scope, by_person
from app.labels.store.draft import Draft
from app.labels.store.frame_ranges import free_spans, outside
from app.labels.wording import frames_text
from pipeline.labels.model import FrameTag


def tag(draft: Draft, scope: Scope, act: Tag) -> str:
    """Add a tag to a range of frames, or remove it."""
    scope.check(act.first, act.last)
    frames = frames_text(act.first, act.last)
    check_seen(draft, "tag", act.first, act.last, act, act.tag)
    if act.on:
        put_tag(draft, FrameTag(act.first, act.last, act.tag, by_person(draft)))
        return f"tagged {frames} {act.tag}"
    _clear(draft, act)
    return f"{frames} {'is' if act.first == act.last else 'are'} not {act.tag}"


def put_tag(draft: Draft, new: FrameTag) -> None:
    """Add a tag to the frames that do not have it yet; tags by others keep their author. Joined with adjacent tags by
    the same person."""
    said = {frame for old in _ranges(draft, new.tag).values() for frame in range(old.first, old.last + 1)}
    for first, last in free_spans(new.first, new.last, said):
        part = replace(new, first=first, last=last)
        joined = []
        for number, old in _ranges(draft, new.tag).items():
            if _by(old) == _by(new) and (old.last + 1 == first or old.first == last + 1):
                part = replace(part, first=min(old.first, part.first), last=max(old.last, part.last))
                joined.append(number)
        draft.put_as_one("tag", joined, part)


def _clear(draft: Draft, act: Tag) -> None:
    """Cut the act's frames out of all ranges of the tag, whoever set it."""
    for number, old in _ranges(draft, act.tag).items():
        if old.last < act.first or old.first > act.last:
            continue
        kept = outside(old, act.first, act.last)
        draft.put("tag", number, kept[0] if kept else None)
        for part in kept[1:]:
            draft.add("tag", part)


def _ranges(draft: Draft, word: str) -> dict[int, FrameTag]:
    """Ranges of a tag, by id."""
    tags = {number: cast("FrameTag", item.value) for number, item in draft.all("tag").items()}
    return {number: each for number, each in tags.items() if each.tag == word}


def _by(tag: FrameTag) -> tuple[str, str]:
    return tag.origin.maker, tag.origin.name
