"""Labels as files and frozen label sets, as types."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from app.labels.acts.request_fields import Person, Strict
from app.labels.store.values import LONGEST_NAME

VERSION_NAME = r"^[A-Za-z0-9][A-Za-z0-9._ -]*$"
"""A version's name is shown and asked for in addresses; it is never a path."""


class VersionJson(BaseModel):
    """A frozen label set. frames: that have a label."""

    name: str
    person: str
    t_unix_ms: int
    tracks: int
    frames: int


class NewVersion(Strict):
    """Freeze the labels as they are now."""

    name: Annotated[str, Field(min_length=1, max_length=LONGEST_NAME, pattern=VERSION_NAME)]
    person: Person


class NativeFile(BaseModel):
    """Our own file: every field of a label set under its own name."""

    format: Literal["cipv-labels"]
    version: int
    labels: dict[str, Any]


class FormatJson(BaseModel):
    """A format of labels."""

    name: str
    """As the other routes take it."""
    title: str
    about: str
    """What it is, in a few words."""


class LostJson(BaseModel):
    """What a format cannot express, one sentence each."""

    lost: list[str]
