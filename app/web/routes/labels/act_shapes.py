"""Requests to change labels and their responses, as types."""

from __future__ import annotations

from typing import Annotated, Any, Literal
from uuid import UUID

from pydantic import Field

from app.labels.acts.request_fields import Person, PersonOrNobody, Strict
from app.labels.acts.requests import Act
from app.labels.store.values import LONGEST_ITEM
from app.labels.tasks import TaskKind
from app.web.routes.labels.shapes import ItemKey, LabelChanges
from app.web.routes.shapes.common import ApiModel

DriveKey = Annotated[str, Field(max_length=LONGEST_ITEM, description="Id of the recording, from GET /api/labels")]


class Sent(Strict):
    """A change."""

    act_id: UUID | None = None
    """Made by who sends it, one for each act: sent again, the act is not done again, and answered as before."""

    @property
    def sent_as(self) -> str | None:
        """The id as stored in the log."""
        return str(self.act_id) if self.act_id is not None else None


class ActBody(Sent):
    """An act on labels."""

    person: Person
    """Whose act it is."""
    drive: DriveKey
    """The recording that is meant; 409 when another one is open."""
    act: Act
    """What is to be done."""


class Who(Sent):
    """Whose newest act to undo, or to redo."""

    person: PersonOrNobody = ""
    """Empty for changes that nobody put a name to."""
    drive: DriveKey | None
    """As of an act; null where what is open has no frames to label."""


class ActedJson(ApiModel):
    """An act that was done and saved."""

    revision: int
    """Of the labels after it."""
    act: int | None
    """Its number; null when nothing changed."""
    what: str
    """In a few words."""
    changed: LabelChanges | None
    """What others get as changes; null when no labels changed."""
    note: str
    """What else there is to say about it."""


class TaskBegun(ApiModel):
    """The act takes longer than a request; ``state.labels.task`` reports its progress."""

    status: Literal["begun"]
    """Tells it from an act that is done."""
    what: TaskKind
    """Kind of work."""
    task: int
    """Its id in the state."""


class StaleJson(ApiModel):
    """A conflict: somebody else changed the item first, and nothing was saved."""

    detail: str
    """What happened, in a sentence."""
    item: ItemKey | None = None
    """What somebody changed; null where it is not one item."""
    theirs: dict[str, Any] | None = None
    """The item as it is now; null when it was removed."""
    yours: dict[str, Any] | None = None
    """What was sent."""
    revision: int | None = None
    """Of the labels in which it is so, to base the act on when it is sent again."""
