"""Jobs that take longer than a request may: progress, cancellation, and a result or an error.

A job does not decide where it runs or what comes after it: exports wait in a queue, label tasks have their own thread,
and opening a recording runs on the engine's worker.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, Literal, TypeVar

from pipeline.common.errors import BadInput, first_line
from pipeline.common.files.user_files import Overloaded
from pipeline.common.progress import Progress

logger = logging.getLogger("cipv.jobs")

JobState = Literal["waiting", "running", "done", "failed", "cancelled"]
ResultT = TypeVar("ResultT")


class Cancelled(Exception):
    """Raised from a job's progress callback, inside its work, after the job has been cancelled."""


@dataclass(frozen=True)
class JobStatus:
    """The state of a job at one moment."""

    state: JobState = "waiting"
    """``done``, ``failed`` and ``cancelled`` are final."""
    done: int = 0
    """Units of work finished; the work chooses the unit."""
    total: int = 0
    """Total units of work; 0 until the work first reports progress."""
    error: str | None = None
    """One sentence with the reason why the job failed."""

    @property
    def has_ended(self) -> bool:
        """Whether the state is final."""
        return self.state not in ("waiting", "running")

    @property
    def fraction(self) -> float:
        """Progress from 0 to 1."""
        return 1.0 if self.state == "done" else self.done / max(self.total, 1)


def _never() -> bool:
    return False


class BackgroundJob(Generic[ResultT]):
    """One piece of work. Call ``run`` once, on the thread that should do it; everything else is safe on any thread.

    Args:
        work: does the work and returns its result. It gets a ``Progress`` to call with (done, total), which raises
            ``Cancelled`` after the job has been cancelled.
        on_change: called on the working thread after changes of ``status``: at most every ``tell_every_s`` during the
            work, and always at its end.
        tell_every_s: shortest time between two calls of ``on_change`` for progress, in seconds.
        is_superseded: polled whenever the work reports progress; true cancels the job.
        name: used in the log.
    """

    def __init__(
        self,
        work: Callable[[Progress], ResultT],
        on_change: Callable[[], object] = lambda: None,
        *,
        tell_every_s: float = 0.0,
        is_superseded: Callable[[], bool] = _never,
        name: str = "job",
    ) -> None:
        self._work: Callable[[Progress], ResultT] | None = work
        self._on_change = on_change
        self._tell_every_s = tell_every_s
        self._is_superseded = is_superseded
        self._name = name
        self._lock = threading.Lock()
        self._status = JobStatus()
        self._result: ResultT | None = None
        self._told_s = -float("inf")

    @property
    def status(self) -> JobStatus:
        """Its progress, or how it ended."""
        return self._status

    @property
    def result(self) -> ResultT | None:
        """What the work returned; None until the job is done."""
        return self._result

    def cancel(self) -> bool:
        """Cancel the job at its next progress report. False if it has already ended."""
        with self._lock:
            if self._status.has_ended:
                return False
            self._status = replace(self._status, state="cancelled")
            self._work = None  # it may reference a whole recording
            return True

    def run(self) -> None:
        """Do the work on this thread. Never raises: an error becomes ``status.error``."""
        with self._lock:
            work, self._work = self._work, None
            if work is None:
                return
            self._status = replace(self._status, state="running")
        try:
            result = work(self._progress)
        except Cancelled:
            self._end("cancelled")
        except (BadInput, Overloaded) as error:
            self._end("failed", error=str(error))
        except Exception as error:  # a failing job must not affect anything else
            logger.exception("%s", self._name)
            self._end("failed", error=f"{type(error).__name__}: {first_line(error)}")
        else:
            self._end("done", result)

    def _progress(self, done: int, total: int) -> None:
        if self._is_superseded():
            self.cancel()
        with self._lock:
            if self._status.state == "cancelled":
                raise Cancelled
            self._status = replace(self._status, done=done, total=total)
            now_s = time.monotonic()
            if now_s - self._told_s < self._tell_every_s:
                return
            self._told_s = now_s
        self._on_change()

    def _end(self, state: JobState, result: ResultT | None = None, error: str | None = None) -> None:
        with self._lock:
            if self._status.state != "cancelled":  # if it was cancelled at the last moment, it stays cancelled
                self._result = result  # set before the state, so that a job that is done has its result
                self._status = replace(self._status, state=state, error=error)
        self._on_change()
