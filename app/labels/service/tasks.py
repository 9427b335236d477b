"""What takes longer than an answer may: one task at a time, which says how far it is and how it ended."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from app.labels.errors import ActRefused
from pipeline.common.errors import BadInput

logger = logging.getLogger("cipv.labels")

TaskKind = Literal["propose", "import"]
_PATIENCE_S = 10.0
_TELL_EVERY_S = 0.1


class Cancelled(Exception):
    """Something else was opened, or the program ends."""


@dataclass(frozen=True)
class TaskState:
    """How far it is. id: its number, which who began it was told. error: why it failed. It stays until the next one
    begins, or what it was about is closed."""

    id: int
    what: TaskKind
    done: int = 0
    total: int = 0
    note: str = ""
    error: str | None = None
    running: bool = True

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


Progress = Callable[[int, int], None]
"""done, total. Raises Cancelled when nobody waits for it any more."""
Work = Callable[[Progress], str]
"""Does it, and says in a sentence what came of it."""


def to_nobody(done: int, total: int) -> None:
    """Progress of what is waited for until its end."""


class Tasks:
    """Any thread. on_change is called when ``state`` is another, while a task goes on ten times a second at most."""

    def __init__(self, on_change: Callable[[], object]) -> None:
        self._on_change = on_change
        self._lock = threading.Lock()
        self._state: TaskState | None = None
        self._thread: threading.Thread | None = None
        self._turn = 0
        self._told_s = 0.0

    @property
    def state(self) -> TaskState | None:
        """None while there was none."""
        return self._state

    def begin(self, what: TaskKind, work: Work) -> int:
        """Its number. ActRefused while another one runs."""
        with self._lock:
            if self._state is not None and self._state.running:
                raise ActRefused(f"{self._state.what} is still running")
            self._turn += 1
            turn = self._turn
            self._state = TaskState(turn, what)
            self._thread = threading.Thread(target=self._run, args=(turn, work), name="cipv-label-task", daemon=True)
        self._thread.start()
        self._on_change()
        return turn

    def cancel(self) -> None:
        """It is not waited for; what it has not written yet it never will."""
        with self._lock:
            self._turn += 1
            self._state = None

    def stop(self) -> None:
        self.cancel()
        thread = self._thread
        if thread is not None and thread.is_alive() and thread is not threading.current_thread():
            thread.join(_PATIENCE_S)

    def _run(self, turn: int, work: Work) -> None:
        def progress(done: int, total: int) -> None:
            self._tell(turn, done=done, total=total)

        try:
            self._tell(turn, note=work(progress), running=False)
        except Cancelled:
            return
        except BadInput as error:
            self._fail(turn, str(error))
        except Exception as error:  # whatever a recording does, the program goes on
            logger.exception("a task on labels")
            self._fail(turn, f"{type(error).__name__}: {error}")

    def _fail(self, turn: int, text: str) -> None:
        try:
            self._tell(turn, error=text, running=False)
        except Cancelled:
            return

    def _tell(self, turn: int, **values: Any) -> None:
        with self._lock:
            if turn != self._turn or self._state is None:
                raise Cancelled
            self._state = replace(self._state, **values)
            now = time.monotonic()
            if self._state.running and now - self._told_s < _TELL_EVERY_S:
                return
            self._told_s = now
        self._on_change()
