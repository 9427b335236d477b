"""Work that takes a while and ends in a file to download: one at a time, in the background, with progress."""

from __future__ import annotations

import logging
import shutil
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from pipeline.common.errors import BadInput

logger = logging.getLogger("cipv.jobs")

MOST_JOBS = 8
_PATIENCE_S = 10.0
JobState = Literal["waiting", "running", "done", "failed", "cancelled"]


class JobRefused(BadInput):
    """A job that cannot be taken; the text says why."""


class Cancelled(Exception):
    """Raised inside a job's work when nobody wants it any more."""


@dataclass(frozen=True)
class Job:
    """progress is 0–1. note: why it failed. file: its name for whoever downloads it, null until it is done."""

    id: str
    kind: str
    first: int
    last: int
    state: JobState = "waiting"
    progress: float = 0.0
    note: str = ""
    file: str | None = None
    bytes: int | None = None


Report = Callable[[int, int], None]
"""Called with (done, total); raises ``Cancelled`` when the job shall end."""
Work = Callable[[Path, Report], None]
"""Writes the file to a path that does not exist yet."""


class Jobs:
    """``submit`` work, read ``get``, download ``path``. Files lie in a folder of their own, under names made here, and
    go with their job. on_end is called on the worker's thread when a job has ended. ``close`` removes everything."""

    def __init__(self, on_end: Callable[[], None] = lambda: None) -> None:
        self._on_end = on_end
        self._folder = Path()
        self._condition = threading.Condition()
        self._jobs: dict[str, Job] = {}
        self._work: dict[str, Work] = {}
        self._number = 0
        self._ended = False
        self._thread: threading.Thread | None = None

    def submit(self, kind: str, first: int, last: int, file: str, work: Work) -> Job:
        """Take a job on. The oldest that has ended goes; JobRefused when too many are under way."""
        with self._condition:
            self._begin()
            self._make_room()
            self._number += 1
            job = Job(f"j{self._number}", kind, first, last, file=file)
            self._jobs[job.id], self._work[job.id] = job, work
            self._condition.notify_all()
            return _public(job)

    def all(self) -> list[Job]:
        """The oldest first."""
        with self._condition:
            return [_public(job) for job in self._jobs.values()]

    def get(self, number: str) -> Job | None:
        """Null when there is no such job."""
        with self._condition:
            job = self._jobs.get(number)
            return _public(job) if job is not None else None

    def path(self, number: str) -> Path | None:
        """Where a finished job's file lies; null otherwise."""
        with self._condition:
            job = self._jobs.get(number)
            return self._folder / number if job is not None and job.state == "done" else None

    def cancel(self, number: str) -> bool:
        """Stop a job, or forget one that has ended; false when there is no such job."""
        with self._condition:
            job = self._jobs.get(number)
            if job is None:
                return False
            if job.state in ("waiting", "running"):
                self._jobs[number] = replace(job, state="cancelled")
                self._work.pop(number, None)
            else:
                self._forget(number)
            return True

    def close(self) -> None:
        """Stop what is under way, and remove every file."""
        with self._condition:
            self._ended = True
            for number, job in self._jobs.items():
                if job.state in ("waiting", "running"):
                    self._jobs[number] = replace(job, state="cancelled")
            self._work.clear()
            self._condition.notify_all()
        if self._thread is not None:
            self._thread.join(_PATIENCE_S)
            shutil.rmtree(self._folder, ignore_errors=True)

    def _begin(self) -> None:
        """Folder and thread are made for the first job: most servers never write one."""
        if self._thread is None:
            self._folder = Path(tempfile.mkdtemp(prefix="cipv-clips-"))
            self._thread = threading.Thread(target=self._run, name="cipv-jobs", daemon=True)
            self._thread.start()

    def _make_room(self) -> None:
        ended = [number for number, job in self._jobs.items() if job.state not in ("waiting", "running")]
        if len(self._jobs) >= MOST_JOBS:
            if not ended:
                raise JobRefused(f"{MOST_JOBS} exports are under way; wait for one to end")
            self._forget(ended[0])

    def _forget(self, number: str) -> None:
        del self._jobs[number]
        (self._folder / number).unlink(missing_ok=True)

    def _run(self) -> None:
        while (begun := self._next()) is not None:
            self._do(*begun)
            del begun  # a job's work holds its recording, and the next one may be long in coming

    def _do(self, number: str, work: Work) -> None:
        path = self._folder / number
        try:
            work(path, lambda done, total: self._progress(number, done, total))
            self._end(number, "done", size=path.stat().st_size)
        except Cancelled:
            self._end(number, "cancelled")
        except BadInput as error:
            self._end(number, "failed", note=str(error))
        except Exception as error:  # one export that fails takes no other with it
            logger.exception("job %s", number)
            self._end(number, "failed", note=f"{type(error).__name__}: {error}")

    def _next(self) -> tuple[str, Work] | None:
        """Wait for a job to begin, and its work; null at the end."""
        with self._condition:
            while not self._ended:
                waiting = [number for number, job in self._jobs.items() if job.state == "waiting"]
                if waiting:
                    self._jobs[waiting[0]] = replace(self._jobs[waiting[0]], state="running")
                    return waiting[0], self._work.pop(waiting[0])
                self._condition.wait()
            return None

    def _progress(self, number: str, done: int, total: int) -> None:
        with self._condition:
            job = self._jobs.get(number)
            if job is None or job.state == "cancelled":
                raise Cancelled
            self._jobs[number] = replace(job, progress=done / max(total, 1))

    def _end(self, number: str, state: JobState, note: str = "", size: int | None = None) -> None:
        with self._condition:
            job = self._jobs.get(number)
            if job is not None and job.state == "cancelled":
                state, size = "cancelled", None
            if state != "done":
                (self._folder / number).unlink(missing_ok=True)
            if job is not None:
                progress = 1.0 if state == "done" else job.progress
                self._jobs[number] = replace(job, state=state, note=note, bytes=size, progress=progress)
        self._on_end()


def _public(job: Job) -> Job:
    return job if job.state == "done" else replace(job, file=None)
