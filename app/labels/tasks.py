"""Label tasks that take longer than a request may: one at a time, with progress and an outcome."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Literal

from app.core.jobs import BackgroundJob
from app.labels.errors import ActRefused
from pipeline.common.progress import Progress

TaskKind = Literal["propose", "import"]
_PATIENCE_S = 10.0
_TELL_EVERY_S = 0.1

TaskWork = Callable[[Progress], str]
"""Does the work and returns one sentence with the outcome."""


@dataclass(frozen=True)
class TaskState:
    """A task at one moment. It stays until the next one begins, or until its recording is closed."""

    id: int
    """Its number, as returned when it was started."""
    what: TaskKind
    """Kind of work."""
    done: int = 0
    """Units of work finished."""
    total: int = 0
    """Units of work in all; 0 until the work first reports."""
    note: str = ""
    """The outcome, once it is done."""
    error: str | None = None
    """Why it failed."""
    running: bool = True
    """False once it has ended, either way."""

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True, eq=False)
class _Task:
    id: int
    what: TaskKind
    job: BackgroundJob[str]
    thread: threading.Thread


class Tasks:
    """Any thread. ``on_change`` is called after changes of ``state``, at most ten times a second while a task runs."""

    def __init__(self, on_change: Callable[[], object]) -> None:
        self._on_change = on_change
        self._lock = threading.Lock()
        self._task: _Task | None = None
        self._last_thread: threading.Thread | None = None
        self._number = 0

    @property
    def state(self) -> TaskState | None:
        """None if there is no task."""
        task = self._task
        if task is None:
            return None
        now = task.job.status
        return TaskState(task.id, task.what, now.done, now.total, task.job.result or "", now.error, not now.has_ended)

    def begin(self, what: TaskKind, work: TaskWork) -> int:
        """Start a task and return its number. ActRefused while another one runs."""
        with self._lock:
            if self._task is not None and not self._task.job.status.has_ended:
                raise ActRefused(f"{self._task.what} is still running")
            self._number += 1
            number = self._number
            job = BackgroundJob(
                work, lambda: self._changed(number), tell_every_s=_TELL_EVERY_S, name=f"label task {what}"
            )
            thread = threading.Thread(target=job.run, name="cipv-label-task", daemon=True)
            self._task, self._last_thread = _Task(number, what, job, thread), thread
        thread.start()
        self._on_change()
        return number

    def cancel(self) -> None:
        """Cancel the task; results not yet written are discarded."""
        with self._lock:
            if self._task is not None:
                self._task.job.cancel()
            self._task = None

    def stop(self) -> None:
        """Cancel the task and wait for its thread, for a limited time."""
        self.cancel()
        thread = self._last_thread
        if thread is not None and thread.is_alive() and thread is not threading.current_thread():
            thread.join(_PATIENCE_S)

    def _changed(self, number: int) -> None:
        task = self._task
        if task is not None and task.id == number:
            self._on_change()
