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
    """Frames asked for whose lead is not labelled."""
    worth: float
    """Expected value of a label per frame."""
    sampled: int
    """Frames asked for, whether labelled since or not."""
    project: str
    """The project that it is in; empty if none."""
    efforts: list[EffortJson]
    """What each person has done there."""


class PersonEffortJson(ApiModel):
    """One person's work on a project."""

    person: str
    """Name."""
    acts: int
    """Changes of labels, including undo and redo."""
    active_s: float
    """Time between acts, without pauses of more than two minutes."""
    frames: int
    """Frames of the recordings that they worked on."""
    acts_per_frame: float
    """Changes per frame of these recordings."""
    s_per_frame: float
    """Active seconds per frame of these recordings."""


class ProjectProgressJson(ApiModel):
    """Progress of one project."""

    name: str
    """The project."""
    sampling: str
    """Its sampling in words; empty if it has none."""
    drives: int
    """Its recordings."""
    done: int
    """Those that are done."""
    frames: int
    """Frames of all."""
    labelled: float
    """Share of these whose lead a person has set."""
    sampled: int
    """Frames asked for, whether labelled since or not."""
    asked: int
    """Those of them whose lead is not labelled."""
    people: list[PersonEffortJson]
    """Everybody who has labelled in it."""


class ControlResultJson(ApiModel):
    """One person's labels in the control frames of a recording, against their truth."""

    project: str
    """The project that the recording is in."""
    title: str
    """The recording."""
    person: str
    """Who labelled."""
    first: int
    """First control frame."""
    last: int
    """Last control frame, included."""
    leads: int
    """Frames among these in which both the truth and the person have a lead."""
    lead_share: float | None
    """Share of these in which both give the same; null without any."""
    vehicles: int
    """True cuboids that the person has labelled."""
    missed: int
    """True cuboids that nobody has labelled, in frames with labelled cuboids."""
    extra: int
    """Cuboids of the person that are no true vehicles."""
    iou: float | None
    """Median overlap of the labelled ones with the truth, seen from above; null without any."""
    class_share: float | None
    """Share of the labelled ones with the right class; null without any."""


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
