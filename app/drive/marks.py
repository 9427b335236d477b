"""Moments that a person marked, stored next to the recordings."""

from __future__ import annotations

import hashlib
import json
import threading
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipeline.common.errors import BadInput
from pipeline.common.files.whole_files import replace_text, set_aside

MOST_MARKS = 10_000
LONGEST_TEXT = 200
LIVE = "live:"
"""Key of marks made with live sensors: they belong to a time, and to every recording that covers it."""


class MarkRefused(BadInput):
    """A mark that cannot be made or stored; the text gives the reason."""


@dataclass(frozen=True)
class SavedMark:
    """A marked frame of one recording."""

    id: int
    """Its number in the recording."""
    index: int
    """Of the frame."""
    text: str = ""
    """The user's text; may be empty."""
    t_ns: int | None = None
    """The frame's timestamp, which identifies the frame for live sensors; None if it had none."""
    in_session: bool = False
    """Whether it was also written to a session that was being recorded."""


class Marks:
    """Marks by recording. Any thread. folder: one small file per recording is stored there; None keeps marks in memory
    only."""

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._marks: dict[str, list[SavedMark]] = {}

    def of(self, uri: str) -> list[SavedMark]:
        """The marks of a recording, ordered by frame."""
        with self._lock:
            return sorted(self._loaded(uri), key=lambda mark: (mark.index, mark.id))

    def add(
        self, uri: str, index: int, text: str = "", *, t_ns: int | None = None, in_session: bool = False
    ) -> SavedMark:
        """Add a mark. MarkRefused if there are too many, or if they cannot be stored."""
        with self._lock:
            marks = self._loaded(uri)
            if len(marks) >= MOST_MARKS:
                raise MarkRefused(f"a recording can have at most {MOST_MARKS} marks")
            number, words = max((each.id for each in marks), default=0) + 1, " ".join(text.split())[:LONGEST_TEXT]
            mark = SavedMark(number, index, words, t_ns, in_session)
            self._save(uri, [*marks, mark])
            return mark

    def remove(self, uri: str, number: int) -> bool:
        """Remove a mark; false if there is none with this number."""
        with self._lock:
            marks = self._loaded(uri)
            rest = [mark for mark in marks if mark.id != number]
            if len(rest) < len(marks):
                self._save(uri, rest)
            return len(rest) < len(marks)

    def _loaded(self, uri: str) -> list[SavedMark]:
        if uri not in self._marks:
            self._marks[uri] = _read(self._file(uri))
        return self._marks[uri]

    def _save(self, uri: str, marks: list[SavedMark]) -> None:
        file = self._file(uri)
        if file is not None:
            text = json.dumps({"uri": uri, "marks": [asdict(mark) for mark in marks]}, ensure_ascii=False)
            try:
                replace_text(file, text)
            except OSError as error:
                raise MarkRefused(f"{file}: the mark cannot be saved: {error.strerror}") from None
        self._marks[uri] = marks

    def _file(self, uri: str) -> Path | None:
        """Named by a digest: a URI is never used as a path."""
        if self._folder is None:
            return None
        return self._folder / f"{hashlib.sha256(uri.encode()).hexdigest()[:16]}.json"


def _read(file: Path | None) -> list[SavedMark]:
    """The stored marks; empty if the file is missing or damaged. A damaged file is set aside."""
    if file is None:
        return []
    try:
        rows = json.loads(file.read_text(encoding="utf-8"))["marks"]
        return [_mark(row) for row in rows]
    except OSError:
        return []
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        set_aside(file)
        return []


def _mark(row: dict[str, Any]) -> SavedMark:
    """A mark as stored; marks from before timestamps were stored have none."""
    t_ns = row.get("t_ns")
    return SavedMark(
        int(row["id"]),
        int(row["index"]),
        str(row["text"]),
        None if t_ns is None else int(t_ns),
        bool(row.get("in_session", False)),
    )
