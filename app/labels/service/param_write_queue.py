"""Queues parameter changes for the log, so that moving a slider never waits for a locked database."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from app.labels.errors import ActRefused
from pipeline.common.errors import BadInput

if TYPE_CHECKING:
    from app.labels.store.act_log import Log

logger = logging.getLogger("cipv.labels")

_MOMENT_S = 0.1
"""An unlocked database needs some milliseconds, so a parameter change is normally on disk when the call returns."""
_PATIENCE_S = 30.0
_MOST = 1000


@dataclass(frozen=True, eq=False)
class _Change:
    uri: str
    log: Callable[[], Log]
    changes: Mapping[str, tuple[Any, Any]]
    person: str
    merges: bool
    over: threading.Event = field(default_factory=threading.Event)


class SettlingQueue:
    """Writes changes one after the other, on its own thread. Any thread. written: called after each write, and after a
    failure. Changes that could not be written are discarded; ``trouble`` reports this until the next successful
    write."""

    def __init__(self, written: Callable[[], object]) -> None:
        self.trouble = ""
        self._written = written
        self._waiting: deque[_Change] = deque()
        self._changed = threading.Condition()
        self._ended = False
        self._thread: threading.Thread | None = None

    def put(
        self, uri: str, log: Callable[[], Log], changes: Mapping[str, tuple[Any, Any]], person: str, *, merges: bool
    ) -> None:
        """Written when this returns if that takes only a moment; else later. uri, log: of the open source."""
        change = _Change(uri, log, changes, person, merges)
        with self._changed:
            if len(self._waiting) >= _MOST:
                return self._failed(1, f"{_MOST} earlier changes are waiting for the database")
            self._waiting.append(change)
            if self._thread is None:
                self._thread = threading.Thread(target=self._write_all, name="cipv-settling", daemon=True)
                self._thread.start()
            self._changed.notify_all()
        change.over.wait(_MOMENT_S)

    def has(self, uri: str, person: str) -> bool:
        """Whether a change that this person could undo is pending."""
        with self._changed:
            return any(change.uri == uri and change.person in ("", person) for change in self._waiting)

    def finish(self) -> None:
        """Wait until all are written, so that the next operation is later in the log. ActRefused if that takes too
        long."""
        with self._changed:
            if not self._changed.wait_for(lambda: not self._waiting, _PATIENCE_S):
                raise ActRefused("an earlier parameter change is still being saved")

    def stop(self) -> None:
        """Pending changes are written first, if the database permits."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(_PATIENCE_S)

    def _write_all(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._ended)
                if not self._waiting:
                    return
                change = self._waiting[0]
            trouble = _written(change)
            with self._changed:
                over = [change] if trouble is None else list(self._waiting)
                if trouble is None:
                    self._waiting.popleft()
                    self.trouble = ""
                else:  # each of the others would wait as long and fail as well
                    self._waiting.clear()
                    self._failed(len(over), trouble)
                self._changed.notify_all()
            self._written()
            for each in over:
                each.over.set()

    def _failed(self, count: int, why: str) -> None:
        many = "A parameter change" if count == 1 else f"{count} parameter changes"
        self.trouble = f"{many} cannot be undone: {why}"
        logger.warning(self.trouble)


def _written(change: _Change) -> str | None:
    """The reason of a failure; None if it was written."""
    try:
        change.log().settle(change.changes, change.person, merges=change.merges)
    except BadInput as error:
        return str(error)
    except Exception as error:  # whatever a database does, the user continues driving and is informed
        logger.exception("a change of parameters")
        return str(error)
    return None
