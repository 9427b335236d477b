"""Prepares the next frame of a playing recording before it is due: reads it and runs the networks on it.

Reading and networks take longer than everything else. On their own thread they block nothing, so a parameter that is
changed meanwhile takes effect at once.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

logger = logging.getLogger("cipv.ahead")


class ReadAhead:
    """Runs ``prepare(index)`` for one index at a time on its own thread. ``on_ready`` is called afterwards on that
    thread. ``watching``: context around all work of the thread. Errors are ignored here; they recur and are handled
    when the frame is actually read."""

    def __init__(
        self,
        prepare: Callable[[int], None],
        on_ready: Callable[[], object],
        watching: Callable[[], AbstractContextManager[object]] = nullcontext,
    ) -> None:
        self._watching = watching
        self._prepare, self._on_ready = prepare, on_ready
        self._condition = threading.Condition()
        self._wanted: int | None = None
        self._under_way: int | None = None
        self._ready: int | None = None
        self._ended = False
        # a hanging read must not keep the program from exiting
        self._thread = threading.Thread(target=self._work, name="cipv-ahead", daemon=True)
        self._thread.start()

    @property
    def ready(self) -> int | None:
        """The last prepared index."""
        with self._condition:
            return self._ready

    @property
    def busy(self) -> bool:
        """Whether a call of ``on_ready`` is pending."""
        with self._condition:
            return self._wanted is not None or self._under_way is not None

    def want(self, index: int) -> None:
        """Prepare this index next, replacing a requested one that has not been started."""
        with self._condition:
            if index in (self._ready, self._under_way):
                return
            self._wanted = index
            self._condition.notify()

    def end(self, patience_s: float = 0.0) -> None:
        """Start nothing more, and wait for the current work, for a limited time."""
        with self._condition:
            self._ended = True
            self._condition.notify()
        if patience_s > 0:
            self._thread.join(patience_s)

    def _work(self) -> None:
        with self._watching():
            self._prepare_all()

    def _prepare_all(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._ended or self._wanted is not None)
                if self._ended:
                    return
                self._under_way, self._wanted = self._wanted, None
                index = self._under_way
            assert index is not None
            try:
                self._prepare(index)
            except Exception:
                logger.debug("frame %s could not be prepared", index, exc_info=True)
            with self._condition:
                self._ready, self._under_way = index, None
            self._on_ready()
