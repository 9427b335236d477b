"""Labels of a drive as files of other tools, for downloads and uploads."""

from __future__ import annotations

import shutil
import tempfile
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO

from app.drive.open_recording import OpenRecording
from app.labels.acts.bulk import importing
from app.labels.errors import ActRefused, BadAct
from app.labels.store.drive_labels import DriveLabels
from app.labels.tasks import TaskWork
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress, silent
from pipeline.labels.classes import ClassList
from pipeline.labels.formats.base import LabeledDrive, drive_of
from pipeline.labels.formats.registry import FORMATS, FormatName, export_labels, import_labels
from pipeline.labels.model import LabelSet, Origin
from pipeline.labels.selection import Selection, selected

_LARGEST_UNPACKED = 512 << 20
_MOST_PARTS = 100_000
_PIECE_BYTES = 1 << 20
_ENCRYPTED = 1
"""Flag of an encrypted file in a .zip (PKWARE's APPNOTE, 4.4.4)."""
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Accepted compression methods, as used by all tools. LZMA is excluded, because its stream may request a dictionary of
gigabytes."""


@dataclass(frozen=True)
class ExportedLabels:
    """A file ready for download."""

    file: Path
    """The file to send; it is in ``folder``."""
    folder: Path
    """Temporary folder, to be removed after sending."""
    lost: tuple[str, ...]
    """What the format cannot express, one sentence each."""


def exported(
    recording: OpenRecording,
    labels: LabelSet,
    name: FormatName,
    only: Selection = "all",
    classes: ClassList | None = None,
) -> ExportedLabels:
    """Export to a file, or a .zip for a format that is a folder. BadInput if that is not possible."""
    folder = Path(tempfile.mkdtemp(prefix="cipv-export-"))
    try:
        which = "" if only == "all" else f"-{only}"
        out = folder / f"labels-{name}{which}{FORMATS[name].suffix}"
        lost = export_labels(selected(labels, only), drive_for(recording), name, out, classes)
        file = _zipped(out) if out.is_dir() else out
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return ExportedLabels(file, folder, lost)


def importing_file(
    labels: DriveLabels, recording: OpenRecording, person: str, file: Path, name: FormatName, classes: ClassList
) -> TaskWork:
    """Import an uploaded file; a format that is a folder is uploaded as a .zip. classes: of the recording's project."""

    def work(progress: Progress) -> str:
        with _removed(file), tempfile.TemporaryDirectory(prefix="cipv-import-") as folder:
            path = file if FORMATS[name].suffix else _unzipped(file, Path(folder))
            drive = drive_for(recording, progress)
            origin = Origin("import", f"{name} file of {person}", int(time.time() * 1000))
            try:
                found = import_labels(path, drive, name, origin, classes)
            except BadInput as error:  # do not reveal its temporary path
                raise ActRefused(str(error).replace(str(path), "the file")) from None
            return importing(labels, found.labels, person, found.notes, progress)

    return work


def drive_for(recording: OpenRecording, progress: Progress = silent) -> LabeledDrive:
    """Description of the drive for label formats: computed once while it is open, and read from its source only if no
    run has read it."""
    with recording.describing:
        if recording.described is None:
            recording.described = drive_of(recording.setup.source, progress, recording.at_hand)
        return recording.described


def _zipped(folder: Path) -> Path:
    out = folder.with_suffix(".zip")
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as made:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                made.write(path, path.relative_to(folder))
    return out


def _unzipped(file: Path, folder: Path) -> Path:
    """The unpacked folder. BadAct if the file is not a .zip, contains paths outside its folder, or expands too much."""
    try:
        with zipfile.ZipFile(file) as packed:
            if any(not each.filename or each.compress_type not in _PACKED for each in packed.infolist()):
                raise BadAct("the .zip has a file without a name, or one that is not packed with deflate")
            parts = [each for each in packed.infolist() if not each.is_dir()]
            if len(parts) > _MOST_PARTS or sum(each.file_size for each in parts) > _LARGEST_UNPACKED:
                raise BadAct(f"the .zip unpacks to more than {_LARGEST_UNPACKED >> 20} MiB")
            if any(each.flag_bits & _ENCRYPTED for each in parts):
                raise BadAct("the .zip needs a password")
            for each in parts:
                name = PurePosixPath(each.filename)
                if name.is_absolute() or ".." in name.parts or "\\" in each.filename:
                    raise BadAct(f"the .zip contains a path outside its folder: {each.filename!r}")
                target = folder / name
                target.parent.mkdir(parents=True, exist_ok=True)
                with packed.open(each) as source, target.open("xb") as out:
                    _copied(source, out, each.file_size)
    except BadInput:
        raise
    except Exception as error:  # for damaged files, zipfile and its decompressors raise arbitrary errors
        raise ActRefused(f"not a valid .zip: {error}") from None
    inside = list(folder.iterdir())
    return inside[0] if len(inside) == 1 and inside[0].is_dir() and inside[0].name.startswith("labels") else folder


def _copied(source: IO[bytes], out: IO[bytes], size: int) -> None:
    """Copies at most the size declared in the .zip, a piece at a time."""
    while data := source.read(min(size + 1, _PIECE_BYTES)):
        size -= len(data)
        if size < 0:
            raise ValueError("a file in it is longer than declared")
        out.write(data)


@contextmanager
def _removed(file: Path) -> Iterator[None]:
    try:
        yield
    finally:
        file.unlink(missing_ok=True)
