"""Runs exports in the background, one at a time. Each produces a file to download."""

from __future__ import annotations

import shutil
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from app.core.jobs import BackgroundJob, JobState
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress

MOST_EXPORTS = 8
_PATIENCE_S = 10.0

WriteFile = Callable[[Path, Progress], None]
"""Writes the file to a path that does not exist yet."""


class ExportRefused(BadInput):
    """Raised if an export cannot be queued; the text says why."""


@dataclass(frozen=True)
class ExportStatus:
    """The state of an export at one moment, as returned by the API."""

    id: str
    """Its number, as used in URLs."""
    kind: str
    """Kind of file, a key of ``EXPORTERS``."""
    first: int
    """First frame of the clip."""
    last: int
    """Last frame of the clip, included."""
    state: JobState = "waiting"
    """``done``, ``failed`` and ``cancelled`` are final."""
    progress: float = 0.0
    """From 0 to 1."""
    note: str = ""
    """The reason of a failure; otherwise empty."""
    file: str | None = None
    """Name of the download; None until it is done."""
    bytes: int | None = None
    """Size of the download; None until it is done."""


@dataclass(frozen=True, eq=False)
class _Export:
    id: str
    kind: str
    first: int
    last: int
    file: str
    path: Path
    job: BackgroundJob[int]
    """Returns the size of the file in bytes."""

    def status(self) -> ExportStatus:
        now = self.job.status
        is_done = now.state == "done"
        file, size = (self.file, self.job.result) if is_done else (None, None)
        return ExportStatus(
            self.id, self.kind, self.first, self.last, now.state, now.fraction, now.error or "", file, size
        )


class ExportQueue:
    """``submit`` an export, read ``get``, download ``path``; ``close`` removes everything. Any thread.

    Files are written to a temporary folder under generated names and are deleted together with their export. ``on_end``
    is called on the worker's thread whenever an export has ended."""

    def __init__(self, on_end: Callable[[], object] = lambda: None) -> None:
        self._on_end = on_end
        self._folder = Path()
        self._condition = threading.Condition()
        self._exports: dict[str, _Export] = {}
        self._number = 0
        self._ended = False
        self._thread: threading.Thread | None = None

    def submit(self, kind: str, first: int, last: int, file: str, write: WriteFile) -> ExportStatus:
        """Queue an export. If the queue is full, the oldest finished one is deleted; ExportRefused if none has
        finished."""
        with self._condition:
            self._begin()
            self._make_room()
            self._number += 1
            number = f"j{self._number}"
            path = self._folder / number
            job = BackgroundJob(partial(_write, write, path), name=f"export {number}")
            export = _Export(number, kind, first, last, file, path, job)
            self._exports[number] = export
            self._condition.notify_all()
            return export.status()

    def all(self) -> list[ExportStatus]:
        """All exports, oldest first."""
        with self._condition:
            return [export.status() for export in self._exports.values()]

    def get(self, number: str) -> ExportStatus | None:
        """An export by its number; None if it does not exist."""
        with self._condition:
            export = self._exports.get(number)
            return export.status() if export is not None else None

    def path(self, number: str) -> Path | None:
        """Path of the file of a finished export; None otherwise."""
        with self._condition:
            export = self._exports.get(number)
            return export.path if export is not None and export.job.status.state == "done" else None

    def cancel(self, number: str) -> bool:
        """Cancel an export, or delete a finished one; False if it does not exist."""
        with self._condition:
            export = self._exports.get(number)
            if export is None:
                return False
            if not export.job.cancel():
                self._delete(export)
            return True

    def close(self) -> None:
        """Cancel running exports and remove every file."""
        with self._condition:
            self._ended = True
            for export in self._exports.values():
                export.job.cancel()
            self._condition.notify_all()
        if self._thread is not None:
            self._thread.join(_PATIENCE_S)
            shutil.rmtree(self._folder, ignore_errors=True)

    def _begin(self) -> None:
        """Create folder and thread for the first export; most servers never write one."""
        if self._thread is None:
            self._folder = Path(tempfile.mkdtemp(prefix="cipv-clips-"))
            self._thread = threading.Thread(target=self._run, name="cipv-exports", daemon=True)
            self._thread.start()

    def _make_room(self) -> None:
        if len(self._exports) < MOST_EXPORTS:
            return
        ended = [export for export in self._exports.values() if export.job.status.has_ended]
        if not ended:
            raise ExportRefused(f"{MOST_EXPORTS} exports are under way; wait for one to finish")
        self._delete(ended[0])

    def _delete(self, export: _Export) -> None:
        del self._exports[export.id]
        export.path.unlink(missing_ok=True)

    def _run(self) -> None:
        while (export := self._next()) is not None:
            export.job.run()
            with self._condition:
                if export.job.status.state != "done":
                    export.path.unlink(missing_ok=True)
            self._on_end()

    def _next(self) -> _Export | None:
        """Wait for the next export to run; None when the queue is closed."""
        with self._condition:
            while not self._ended:
                for export in self._exports.values():
                    if export.job.status.state == "waiting":
                        return export
                self._condition.wait()
            return None


def _write(write: WriteFile, path: Path, progress: Progress) -> int:
    write(path, progress)
    return path.stat().st_size
