"""Saved alignments, each with date, drive, score and note, so that an earlier one can be restored."""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipeline.common.errors import BadInput
from pipeline.common.files.whole_files import replace_text, set_aside
from pipeline.params import Params, flat, with_changes

MOST = 500
LONGEST_NOTE = 200
SECTION = "alignment."


class VersionRefused(BadInput):
    """A version that cannot be stored; the text gives the reason."""


@dataclass(frozen=True)
class AlignmentVersion:
    """One saved alignment."""

    id: int
    """Its number."""
    saved_at: str
    """Time of saving, ISO 8601, UTC."""
    drive: str
    """Title of the recording that was open."""
    note: str
    """The user's note."""
    values: Mapping[str, Any]
    """Every alignment parameter by dotted name."""
    match: float | None
    """Share of the best nearby alignment's edge score, 0–1; None if the drive could not tell."""
    iou: float | None
    """Mean overlap of boxes and projected clusters if the version comes from a fit; else None."""


class AlignmentVersions:
    """Any thread. file: where versions are stored; None keeps them in memory only."""

    def __init__(self, file: Path | None = None) -> None:
        self._file = file
        self._lock = threading.Lock()
        self._versions = _read(file)

    def all(self) -> list[AlignmentVersion]:
        """All versions, newest first."""
        with self._lock:
            return self._versions[::-1]

    def add(
        self, params: Params, drive: str, saved_at: str, note: str = "", *, match: float | None, iou: float | None
    ) -> AlignmentVersion:
        """Store the alignment of ``params``. VersionRefused if there are too many, or if it cannot be saved."""
        with self._lock:
            if len(self._versions) >= MOST:
                raise VersionRefused(f"{MOST} alignments are saved; delete some")
            number = max((each.id for each in self._versions), default=0) + 1
            words = " ".join(note.split())[:LONGEST_NOTE]
            version = AlignmentVersion(number, saved_at, drive, words, alignment_of(params), match, iou)
            self._save([*self._versions, version])
            return version

    def remove(self, number: int) -> bool:
        """Remove a version; false if there is none with this number."""
        with self._lock:
            rest = [each for each in self._versions if each.id != number]
            if len(rest) == len(self._versions):
                return False
            self._save(rest)
            return True

    def _save(self, versions: list[AlignmentVersion]) -> None:
        if self._file is not None:
            text = json.dumps([asdict(each) for each in versions], ensure_ascii=False, indent=1)
            try:
                replace_text(self._file, text)
            except OSError as error:
                raise VersionRefused(f"{self._file}: the alignment cannot be saved: {error.strerror}") from None
        self._versions = versions


def alignment_of(params: Params) -> dict[str, Any]:
    """Every alignment parameter by dotted name."""
    return {name: value for name, value in flat(params).items() if name.startswith(SECTION)}


def _read(file: Path | None) -> list[AlignmentVersion]:
    """The stored versions; entries that are no longer valid are left out, and a damaged file is set aside."""
    if file is None:
        return []
    try:
        rows = json.loads(file.read_text(encoding="utf-8"))
    except OSError:
        return []
    except (ValueError, RecursionError):
        rows = None
    if not isinstance(rows, list):
        set_aside(file)
        return []
    return [version for row in rows if (version := _version(row)) is not None]


def _version(row: Any) -> AlignmentVersion | None:
    try:
        values = {str(name): value for name, value in row["values"].items() if str(name).startswith(SECTION)}
        with_changes(Params(), values)
        texts = (str(row[name]) for name in ("saved_at", "drive", "note"))
        scores = (None if row[name] is None else float(row[name]) for name in ("match", "iou"))
        saved_at, drive, note = texts
        match, iou = scores
        return AlignmentVersion(int(row["id"]), saved_at, drive, note, values, match, iou)
    except (BadInput, ValueError, KeyError, TypeError, AttributeError, OverflowError):
        return None
