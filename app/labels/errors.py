"""Errors of label access: why an act is refused, or labels are not available."""

from __future__ import annotations

from typing import Any

from pipeline.common.errors import BadInput


class DatabaseError(BadInput):
    """The database cannot be reached, read or written; the text says which one and why, without passwords."""


class ActRefused(BadInput):
    """The act is not possible with the current labels; nothing was written."""


class NotAllowed(BadInput):
    """The account's role does not include it."""


class BadAct(BadInput):
    """The act is invalid, whatever the labels are."""


class NoSuchLabel(BadInput):
    """The referenced item does not exist, or no longer does."""


class Stale(ActRefused):
    """Somebody has changed the item since. theirs: the current item; None if it was removed. revision: revision of the
    labels that contains it."""

    def __init__(self, text: str, kind: str, number: int, theirs: dict[str, Any] | None, revision: int = 0) -> None:
        super().__init__(text)
        self.kind, self.number, self.theirs, self.revision = kind, number, theirs, revision
