"""`cipv labels export` and `import`: labels as files of other tools, and back."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from app.progress import frames_progress, opened_recording
from pipeline.labels.formats.base import Drive, FormatName, drive_of
from pipeline.labels.formats.native import from_json, onto
from pipeline.labels.formats.reading import read_bytes
from pipeline.labels.formats.registry import export_labels, import_labels
from pipeline.labels.model import LabelSet, Origin
from pipeline.labels.truth import truth_labels
from pipeline.sources.base import Source

_NOBODY_KNOWS_WHEN = 0
"""The truth of a recording was made before it was opened; the same recording gives the same file."""


@dataclass(frozen=True)
class ExportLabels:
    """Write the labels of a recording for another tool, and say what that tool's format has no place for.

    Example: cipv labels export kitti:DRIVE --format nuscenes --out labels
    """

    source: tyro.conf.Positional[str]
    """The recording: a session.mcap, astyx:<dir>, kitti:<dir>, sim:<scenario>, …"""
    format: FormatName
    """Which kind of file"""
    out: Path
    """The file or folder to write; there may be none yet"""
    labels: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """A file of our own with the labels; else the truth that comes with the recording"""

    def __call__(self) -> int:
        source = opened_recording(self.source)
        drive = _drive(source)
        labels, notes = _labels_of(source, drive, self.labels)
        lost = export_labels(labels, drive, self.format, self.out)
        _say(*notes, *lost, f"{self.out}: {_amount(labels)}")
        return 0


@dataclass(frozen=True)
class ImportLabels:
    """Read labels of a recording that another tool wrote into a file of our own.

    Example: cipv labels import kitti:DRIVE label_2 --format kitti --out labels.json
    """

    source: tyro.conf.Positional[str]
    """The recording: a session.mcap, astyx:<dir>, kitti:<dir>, sim:<scenario>, …"""
    file: tyro.conf.Positional[Path]
    """The file or folder to read"""
    format: FormatName
    """Which kind of file it is"""
    out: Path
    """The file to write; there may be none yet"""

    def __call__(self) -> int:
        source = opened_recording(self.source)
        drive = _drive(source)
        file = self.file.expanduser()
        origin = Origin("import", file.name, file.stat().st_mtime_ns // 1_000_000)
        found = import_labels(file, drive, self.format, origin)
        export_labels(found.labels, drive, "native", self.out)
        _say(*found.notes, f"{self.out}: {_amount(found.labels)}")
        return 0


def _drive(source: Source) -> Drive:
    with frames_progress() as bar:
        task = bar.add_task(source.title, total=len(source))
        return drive_of(source, lambda done, total: bar.update(task, completed=done, total=total))


def _labels_of(source: Source, drive: Drive, file: Path | None) -> tuple[LabelSet, tuple[str, ...]]:
    """The labels of a file of our own, else the recording's truth, with what there is to say of them."""
    if file is not None:
        placed = onto(from_json(read_bytes(file.expanduser()), str(file)), drive, str(file))
        return placed.labels, placed.notes
    return truth_labels(source, drive.frames, Origin("import", source.title, _NOBODY_KNOWS_WHEN))


def _amount(labels: LabelSet) -> str:
    sightings = sum(len(track.sightings) for track in labels.tracks)
    return f"tracks {len(labels.tracks):,}, sightings {sightings:,}, ranges of the lead {len(labels.leads):,}"


def _say(*sentences: str) -> None:
    for sentence in sentences:
        print(f"cipv: {sentence}", file=sys.stderr)


@dataclass(frozen=True)
class Labels:
    """Labels of a recording as files of other tools, and back."""

    action: (
        Annotated[ExportLabels, tyro.conf.subcommand("export")]
        | Annotated[ImportLabels, tyro.conf.subcommand("import")]
    )

    def __call__(self) -> int:
        return self.action()
