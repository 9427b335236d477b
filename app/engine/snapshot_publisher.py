"""The worker publishes snapshots here; others read the latest one or listen for new ones."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from app.engine.snapshot import Snapshot

logger = logging.getLogger("cipv.engine")

Listener = Callable[[Snapshot], None]


class SnapshotPublisher:
    """Holds the newest snapshot. ``publish`` is called on the worker's thread, everything else on any thread."""

    def __init__(self, first: Snapshot) -> None:
        self.snapshot = first
        self._listeners: list[Listener] = []
        self._changed = threading.Condition()

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Call ``listener`` on the worker's thread after every change; it must be quick. Returns a function that
        unsubscribes."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def wait_for(self, condition: Callable[[Snapshot], bool], timeout_s: float) -> Snapshot:
        """The first snapshot that satisfies ``condition``; TimeoutError if there is none in time."""
        with self._changed:
            if not self._changed.wait_for(lambda: condition(self.snapshot), timeout_s):
                raise TimeoutError(f"no such snapshot within {timeout_s:g} s; last: {self.snapshot.state_json()}")
            return self.snapshot

    def publish(self, snapshot: Snapshot) -> None:
        """Set the snapshot, and notify the listeners if it has changed."""
        with self._changed:
            changed = snapshot != self.snapshot
            self.snapshot = snapshot
            self._changed.notify_all()
        if changed:
            for listener in tuple(self._listeners):
                self._tell(listener, snapshot)

    def _tell(self, listener: Listener, snapshot: Snapshot) -> None:
        try:
            listener(snapshot)
        except Exception:  # a view that fails must not affect the engine or other views
            logger.exception("a view failed on frame %s", snapshot.index)
