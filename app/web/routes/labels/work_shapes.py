"""The queue of recordings to label, as types."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from app.labels.acts.request_fields import Person, PersonOrNobody, Strict
from app.labels.work_states import State
from app.web.routes.shapes.common import ApiModel


class EffortJson(ApiModel):
    """One person's work on a recording."""

    person: str
    """Name."""
    acts: int
    """Changes of labels, including undo and redo."""
    active_s: float
    """Time between acts, without pauses of more than two minutes."""


class WorkJson(ApiModel):
    """Labeling state of a recording."""

    key: str
    """Derived from its content."""
    title: str
    """Display name."""
    uri: str
    """Where it was first opened."""
    frames: int
    """Number of frames."""
    person: str
    """Who labels it; empty if unassigned."""
    state: State
    """open, labeling, review or done."""
    labelled: float
    """Share of frames whose lead a person has set."""
    reviewed: float
    """Share of accepted tracks that a second person has reviewed."""
    proposals: int
    """Proposals that nobody has looked at."""
    asked: int
    """Queued frames whose lead is not labelled."""
    worth: float
    """Expected value of a label per frame."""
    sampled: int
    """Frames queued by hand or by sampling, whether labelled since or not."""
    project: str
    """The project that it is in; empty if none."""
    open_proposals: int
    """Labels of any kind that are only proposed, or were sent back."""
    unreviewed: int
    """Accepted labels of any kind that no second person has reviewed."""
    efforts: list[EffortJson]
    """What each person has done there."""


class WorkChange(Strict):
    """Assign a recording, or set its state."""

    person: Person
    """Who changes it."""
    drive: Annotated[str, Field(min_length=1, max_length=200)]
    """Its key."""
    assign: PersonOrNobody | None = None
    """Who labels it; empty for nobody, null to leave it."""
    state: State | None = None
    """Its new state; null to leave it."""
    anyway: bool = False
    """Mark it as done although proposals are open or labels not reviewed; accounts need the role admin."""
