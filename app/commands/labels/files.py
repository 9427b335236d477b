"""`cipv labels export` and `import`: convert labels of recordings to and from the files of other tools."""

from __future__ import annotations

import getpass
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from app.commands.support.arguments import option
from app.commands.support.open_with_progress import opened_recording
from app.commands.support.options import RecordingName
from app.commands.support.progress_bars import frames_progress, task_progress
from app.labels.project_classes import project_classes
from app.labels.wording import WORKING
from pipeline.common.files.user_file_errors import given_path
from pipeline.common.garbage_collection import gc_paused
from pipeline.labels.classes import ClassList, read_classes
from pipeline.labels.formats.base import LabeledDrive, drive_of
from pipeline.labels.formats.native import from_json, onto
from pipeline.labels.formats.reading import read_bytes
from pipeline.labels.formats.registry import FormatName, export_labels, import_labels
from pipeline.labels.model import LabelSet, Origin
from pipeline.labels.recorded_truth import truth_labels
from pipeline.labels.selection import Selection, selected
from pipeline.types.source import Source

if TYPE_CHECKING:
    from app.labels.store.drive_labels import DriveLabels

_NOBODY_KNOWS_WHEN = 0
"""Time of change of labels that come with a recording: a constant, so that the same recording gives the same file."""

Database = Annotated[str | None, option("URL")]
Person = Annotated[str, tyro.conf.arg(metavar="NAME")]


def account() -> str:
    """Name of the account that runs the command: who labels, unless a name is given. Its number if it has no name, as
    in a container that is started for a number."""
    try:
        return getpass.getuser()
    except (KeyError, ImportError, OSError):  # OSError from Python 3.13 on, ImportError before on Windows
        return f"account {os.getuid()}" if hasattr(os, "getuid") else "unnamed account"


@dataclass(frozen=True)
class ExportLabels:
    """Write the labels of a recording in another tool's format, and report what that format cannot express. Without
    --labels: the labels in the database if there are any, otherwise the truth that comes with the recording.

    Example: cipv labels export kitti:DRIVE --format nuscenes --out labels
    """

    source: RecordingName
    format: FormatName
    """File format"""
    out: Path
    """The file or folder to write; must not exist"""
    labels: Annotated[Path | None, option("FILE")] = None
    """A file of labels in the native format"""
    version: Annotated[str, tyro.conf.arg(metavar="NAME")] = WORKING
    """A frozen version of the labels in the database; default: their current state"""
    only: Selection = "all"
    """Write only accepted labels, or only those that a second person reviewed; the set's name says so"""
    database: Database = None
    """Label database; default: $CIPV_LABELS_URL, then sessions/labels.db"""

    def __call__(self) -> int:
        source = opened_recording(self.source)
        drive = _drive(source)
        labels, notes, classes = self._labels(source, drive)
        labels = selected(labels, self.only)
        lost = export_labels(labels, drive, self.format, self.out, classes or project_classes())
        say(*notes, *lost, f"{self.out}: {_amount(labels)}")
        return 0

    def _labels(self, source: Source, drive: LabeledDrive) -> tuple[LabelSet, tuple[str, ...], ClassList | None]:
        """The labels to export, notes about them, and the class list of the recording's project, if it has one."""
        if self.labels is not None:
            with gc_paused():
                found = from_json(read_bytes(given_path(self.labels)), str(self.labels))
                placed = onto(found, drive, str(self.labels))
            return placed.labels, placed.notes, None
        with _kept(source, drive, self.database) as kept:
            if self.version != WORKING or kept.has_labels():
                return kept.label_set(self.version), (), kept.classes()
        truth, notes = truth_labels(source, drive.frames, Origin("import", source.title, _NOBODY_KNOWS_WHEN))
        return truth, notes, None


@dataclass(frozen=True)
class ImportLabels:
    """Read labels that another tool wrote: into the database, in addition to those already there, or with --out into a
    file in the native format.

    Example: cipv labels import kitti:DRIVE label_2 --format kitti
    """

    source: RecordingName
    file: tyro.conf.Positional[Path]
    """The file or folder to read"""
    format: FormatName
    """File format"""
    out: Annotated[Path | None, option("PATH")] = None
    """The file to write; must not exist"""
    database: Database = None
    """Label database; default: $CIPV_LABELS_URL, then sessions/labels.db"""
    person: Person = field(default_factory=account)
    """Author of the change, who can undo it in the dashboard"""
    classes: Annotated[Path | None, option("FILE")] = None
    """A class list (YAML), by which names in the file are read; default: that of the recording's project in the
    database, then the one that `cipv labels classes` lists"""

    def __call__(self) -> int:
        source = opened_recording(self.source)
        drive = _drive(source)
        file = given_path(self.file)
        origin = Origin("import", file.name, file.stat().st_mtime_ns // 1_000_000)
        if self.out is not None:
            found = import_labels(file, drive, self.format, origin, self._classes() or project_classes())
            export_labels(found.labels, drive, "native", self.out)
            say(*found.notes, f"{self.out}: {_amount(found.labels)}")
            return 0
        with _kept(source, drive, self.database) as kept:
            from app.labels.acts.bulk import importing  # imported only if needed

            classes = self._classes() or kept.classes() or project_classes()
            found = import_labels(file, drive, self.format, origin, classes)
            say(importing(kept, found.labels, self.person, found.notes))
        return 0

    def _classes(self) -> ClassList | None:
        return read_classes(given_path(self.classes)) if self.classes is not None else None


@contextmanager
def _kept(source: Source, drive: LabeledDrive, url: str | None) -> Iterator[DriveLabels]:
    """The database's labels of a recording."""
    from app.labels.store.database import open_database  # imported only if needed, as above
    from app.labels.store.drive_labels import DriveLabels, info_of

    database = open_database(url)
    try:
        yield DriveLabels(database, info_of(source, lambda: drive.frames))
    finally:
        database.close()


def _drive(source: Source) -> LabeledDrive:
    with frames_progress() as bar:
        return drive_of(source, task_progress(bar, source.title, len(source)))


def _amount(labels: LabelSet) -> str:
    sightings = sum(len(track.sightings) for track in labels.tracks)
    return f"tracks {len(labels.tracks):,}, sightings {sightings:,}, lead ranges {len(labels.leads):,}"


def say(*sentences: str) -> None:
    """Print notes to standard error, since results go to standard output."""
    for sentence in sentences:
        print(f"cipv: {sentence}", file=sys.stderr)
