"""What is sent to change labels, and what is answered, as types."""

from __future__ import annotations

from typing import Annotated, Any, Literal
from uuid import UUID

from pydantic import BaseModel, Field

from app.labels.acts.request_fields import Person, PersonOrNobody, Strict
from app.labels.acts.requests import Act
from app.labels.service.tasks import TaskKind
from app.labels.store.values import LONGEST_ITEM
from app.web.routes.labels.shapes import ItemKey, LabelChanges

DriveKey = Annotated[str, Field(max_length=LONGEST_ITEM, description="Id of the recording, of GET /api/labels")]


class Sent(Strict):
    """act_id: made by who sends it, one for each act: sent again, the act is not done again, and answered as before."""

    act_id: UUID | None = None

    @property
    def sent_as(self) -> str | None:
        """The id as the log keeps it."""
        return str(self.act_id) if self.act_id is not None else None


class ActBody(Sent):
    """person: whose act it is. drive: the recording that is meant; 409 when another one is open."""

    person: Person
    drive: DriveKey
    act: Act


class Who(Sent):
    """person: whose newest act is meant. drive: as of an act; null where what is open has no frames to label."""

    person: PersonOrNobody = ""
    drive: DriveKey | None


class ActedJson(BaseModel):
    """It is on disk. act: its number, null when nothing changed. what: in a few words. changed: what others get as
    changes. note: what there is to say about it."""

    revision: int
    act: int | None
    what: str
    changed: LabelChanges | None
    note: str


class TaskBegun(BaseModel):
    """It goes on; ``state.labels.task`` tells how far it is. task: its id there."""

    status: Literal["begun"]
    what: TaskKind
    task: int


class StaleJson(BaseModel):
    """Nothing was written. item: what somebody changed; theirs: it as it is now, null when it was removed; yours: what
    was sent; revision: of the labels in which it is so, to base the act on when it is sent again."""

    detail: str
    item: ItemKey | None = None
    theirs: dict[str, Any] | None = None
    yours: dict[str, Any] | None = None
    revision: int | None = None
