"""Removing all labels at once: a second person starts without seeing those of the first."""

from __future__ import annotations

from typing import cast

from app.labels.acts.requests import ClearAll
from app.labels.acts.scope import Scope
from app.labels.errors import ActRefused
from app.labels.store.draft import Draft
from app.labels.store.values import KINDS
from pipeline.labels.model import NEXT_TAG, FrameTag


def clear_all(draft: Draft, scope: Scope, act: ClearAll) -> str:
    """Remove everything but the tags that queue frames. ActRefused if there is nothing, or if somebody has changed
    labels since ``act.revision``."""
    if draft.number - 1 != act.revision:
        raise ActRefused("somebody has changed labels since; freeze them again")
    gone = [
        (kind, number)
        for kind in KINDS
        for number, item in draft.all(kind).items()
        if not (kind == "tag" and cast("FrameTag", item.value).tag == NEXT_TAG)
    ]
    if not gone:
        raise ActRefused("there are no labels to remove")
    for kind, number in gone:
        draft.put(kind, number, None)
    tracks = sum(kind == "track" for kind, _ in gone)
    return f"removed all labels, {tracks} track{'' if tracks == 1 else 's'} among them"
