"""The file that describes a project, in YAML."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError

from app.labels.acts.request_fields import Person, Strict
from app.labels.projects.sampling import Sampling
from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import first_complaint, given_path, read_yaml
from pipeline.common.files.user_files import LARGEST_TEXT_BYTES, read_regular
from pipeline.labels.classes import read_classes
from pipeline.labels.formats.native import from_json
from pipeline.labels.formats.reading import read_bytes
from pipeline.labels.model import LabelSet

_MOST_DRIVES = 10_000
AddressText = Annotated[str, Field(min_length=1, max_length=4096)]


class ControlEntry(Strict):
    """Frames of a recording whose truth is known."""

    drive: AddressText
    """One of the project's recordings."""
    truth: AddressText
    """A file of labels in the native format, relative to the project's file."""
    first: int | None = Field(None, ge=1)
    """First frame, counted from 1 as in the page; None for the recording's first."""
    last: int | None = Field(None, ge=1)
    """Last frame, included; None for the recording's last."""


class ProjectEntries(Strict):
    """The file's content."""

    name: Annotated[Person, Field(pattern="^[^:]*$")]
    """The project; without a colon, which ends it where the queue shows who asked for a frame."""
    drives: Annotated[list[AddressText], Field(min_length=1, max_length=_MOST_DRIVES)]
    """Its recordings, as they are opened: paths relative to where the command runs, or addresses."""
    classes: AddressText | None = None
    """A class list, relative to this file; None for the server's list."""
    sampling: Sampling | None = None
    """Which frames enter the queue; None for those that people and `cipv mine` ask for."""
    control: list[ControlEntry] = Field(default_factory=list)
    """Frames with known truth."""


@dataclass(frozen=True)
class ProjectFile:
    """A project with the files that it names."""

    entries: ProjectEntries
    """The file's content."""
    classes: str
    """The class list as YAML; empty for the server's."""
    truths: tuple[LabelSet, ...]
    """The labels of each control entry."""


def read_project(path: Path) -> ProjectFile:
    """A project from its file. BadInput, in one sentence, if this or a file that it names is invalid."""
    try:
        entries = ProjectEntries.model_validate(read_yaml(path, str(path)))
    except ValidationError as error:
        raise BadInput(f"{path}: {first_complaint(error, ProjectEntries)}") from None
    for each in entries.control:
        if each.drive not in entries.drives:
            raise BadInput(f"{path}: control: {each.drive} is not among the drives")
        if each.first is not None and each.last is not None and each.first > each.last:
            raise BadInput(f"{path}: control: first is after last")
    classes = ""
    if entries.classes is not None:
        listed = path.parent / given_path(entries.classes)
        read_classes(listed)
        classes = read_regular(listed, LARGEST_TEXT_BYTES).decode("utf-8")
    truths = [path.parent / given_path(each.truth) for each in entries.control]
    return ProjectFile(entries, classes, tuple(from_json(read_bytes(file), str(file)) for file in truths))
