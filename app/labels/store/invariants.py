"""Invariants of a drive's labels, whoever made them: each frame has one lead, one path and each tag once, and every
track referred to exists."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

from app.labels.errors import ActRefused
from app.labels.store.draft import Draft, name_of
from app.labels.store.values import Item, ItemKind
from app.labels.wording import frames_text
from pipeline.labels.model import EventLabel, FrameTag, LeadRange, PathLabel


def check_whole(draft: Draft) -> None:
    """ActRefused if the draft's changes are inconsistent with the existing labels. Two people's acts can each be valid,
    while undoing one of them would be inconsistent with the other."""
    touched = draft.touched
    kinds = {kind for kind, _ in touched}
    if "lead" in kinds:
        _check_apart(draft, _all(draft, "lead"))
    if "path" in kinds:
        _check_paths(draft)
    if "tag" in kinds:
        by_word: dict[str, list[Item]] = {}
        for item in _all(draft, "tag"):
            by_word.setdefault(cast("FrameTag", item.value).tag, []).append(item)
        for items in by_word.values():
            _check_apart(draft, items)
    gone = {number for kind, number in touched if kind == "track" and draft.find("track", number) is None}
    if gone or kinds & {"lead", "event"}:
        _check_named(draft, gone)


def _check_apart(draft: Draft, items: Iterable[Item]) -> None:
    """Ranges are sorted by start; each is compared with the earlier one that extends farthest."""
    farthest: Item | None = None
    for item in sorted(items, key=lambda item: cast("LeadRange | FrameTag", item.value).first):
        here = cast("LeadRange | FrameTag", item.value)
        before = cast("LeadRange | FrameTag | None", farthest.value if farthest else None)
        if farthest is not None and before is not None and here.first <= before.last:
            _clash(draft, farthest, item, frames_text(here.first, min(here.last, before.last)))
        if before is None or here.last > before.last:
            farthest = item


def _check_paths(draft: Draft) -> None:
    there: dict[int, Item] = {}
    for item in _all(draft, "path"):
        frame = cast("PathLabel", item.value).frame
        other = there.setdefault(frame, item)
        if other is not item:
            _clash(draft, other, item, frames_text(frame))


def _clash(draft: Draft, one: Item, other: Item, where: str) -> None:
    """An overlap that existed before is not refused."""
    if (one.kind, one.id) in draft.touched:
        one, other = other, one
    if (other.kind, other.id) in draft.touched:
        named = name_of(one.kind, one.id)
        raise ActRefused(f"{where} would have two {one.kind}s: {draft.who(one.revision)} made {named} there")


def _check_named(draft: Draft, gone: set[int]) -> None:
    """gone: the tracks removed by the draft."""
    for kind in ("lead", "event"):
        for item in _all(draft, kind):
            names = _tracks_of(item)
            if (kind, item.id) in draft.touched:
                missing = {number for number in names if draft.find("track", number) is None}
            else:
                missing = names & gone
            if missing:
                raise ActRefused(f"{name_of(kind, item.id)} names #{min(missing)}, which would no longer exist")


def _tracks_of(item: Item) -> set[int]:
    if isinstance(item.value, EventLabel):
        return set(item.value.tracks)
    lead = cast("LeadRange", item.value).lead
    return {lead} if isinstance(lead, int) else set()


def _all(draft: Draft, kind: ItemKind) -> list[Item]:
    return list(draft.all(kind).values())
