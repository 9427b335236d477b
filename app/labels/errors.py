"""Errors of label access: why an act is refused, or labels are not available."""

from __future__ import annotations

from typing import Any

from pipeline.common.errors import BadInput


class DatabaseError(BadInput):
    """The database cannot be reached, read or written; the text says which and why, never with a password."""


class ActRefused(BadInput):
    """It cannot be done to these labels as they stand; nothing was written."""


class BadAct(BadInput):
    """It makes no sense, whatever the labels are."""


class NoSuchLabel(BadInput):
    """What it is about is not, or no longer, there."""


class Stale(ActRefused):
    """Somebody changed an item, of that kind and number, since. theirs: the item as it stands; None where it was
    removed. revision: of the labels in which it stands so."""

    def __init__(self, text: str, kind: str, number: int, theirs: dict[str, Any] | None, revision: int = 0) -> None:
        super().__init__(text)
        self.kind, self.number, self.theirs, self.revision = kind, number, theirs, revision
