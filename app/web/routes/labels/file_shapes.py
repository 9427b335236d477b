"""Labels as files and frozen label sets, as types."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from app.labels.acts.request_fields import Person, Strict
from app.labels.store.values import LONGEST_NAME
from app.web.routes.shapes.common import ApiModel

VERSION_NAME = r"^[A-Za-z0-9][A-Za-z0-9._ -]*$"
"""A version's name is displayed and used in URLs; it is never a path."""


class VersionJson(ApiModel):
    """A frozen label set."""

    name: str
    """Unique within the drive."""
    person: str
    """Who froze it."""
    t_unix_ms: int
    """When, in Unix milliseconds."""
    tracks: int
    """Labelled vehicles."""
    frames: int
    """That have a label."""
    signed_by: str
    """Public key that it is signed with, hexadecimal; empty where it is not signed"""


class AgreementJson(ApiModel):
    """How two label sets of the recording agree. Shares are null where there is nothing to compare."""

    frames: int
    """Frames in which both have a lead label."""
    lead_share: float | None
    """Share of these with the same lead."""
    lead_disagreements: list[int]
    """Indices of the frames in which the leads differ."""
    vehicles: int
    """Cuboids that both have, frame by frame."""
    only_first: int
    """Cuboids that only the first set has, in frames in which both have some."""
    only_second: int
    """Cuboids that only the second set has, in the same frames."""
    iou: float | None
    """Median overlap of the cuboids that both have, seen from above."""
    class_share: float | None
    """Share of these with the same class."""
    reversed_share: float | None
    """Share of these with opposite headings."""


class NewVersion(Strict):
    """Freeze the labels as they are now."""

    name: Annotated[str, Field(min_length=1, max_length=LONGEST_NAME, pattern=VERSION_NAME)]
    """As files may be called."""
    person: Person
    """Who freezes it."""


class NativeFile(ApiModel):
    """The native file format: every field of a label set under its own name."""

    format: Literal["cipv-labels"]
    """Tells the file from others."""
    version: int
    """Of the format."""
    labels: dict[str, Any]
    """The label set."""


class FormatJson(ApiModel):
    """A format of labels."""

    name: str
    """As the other routes take it."""
    title: str
    """For people."""
    about: str
    """What it is, in a few words."""


class LostJson(ApiModel):
    """What a format cannot express, one sentence each."""

    lost: list[str]
    """Empty when everything has a place."""
