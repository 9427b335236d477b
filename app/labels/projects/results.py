"""What is known of projects: their progress, and the results in control frames. The API returns these types."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import ConfigDict

API = ConfigDict(use_attribute_docstrings=True)
"""The docstring of each field becomes its description in OpenAPI."""


@dataclass(frozen=True)
class PersonEffort:
    """One person's work on a project."""

    __pydantic_config__ = API

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
    """Active time per frame of these recordings."""


@dataclass(frozen=True)
class ProjectProgress:
    """Progress of one project."""

    __pydantic_config__ = API

    name: str
    """The project."""
    sampling: str
    """Its sampling in words; empty if it has none."""
    drives: int
    """Number of its recordings."""
    done: int
    """Number of those that are done."""
    frames: int
    """Number of frames of all."""
    labelled: float
    """Share of these whose lead a person has set."""
    sampled: int
    """Frames requested for labeling."""
    asked: int
    """Number of these whose lead is not labelled."""
    people: tuple[PersonEffort, ...]
    """Everybody who has labelled in it."""


@dataclass(frozen=True)
class ControlResult:
    """One person's labels in the control frames of one recording. Shares are None if there is nothing to compare."""

    __pydantic_config__ = API

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
    """Share of these in which both give the same."""
    vehicles: int
    """True cuboids that the person has labelled."""
    missed: int
    """True cuboids that nobody has labelled, in frames with labelled cuboids."""
    extra: int
    """Cuboids of the person that are no true vehicles."""
    iou: float | None
    """Median overlap of the labelled ones with the truth, seen from above."""
    class_share: float | None
    """Share of the labelled ones with the right class."""
