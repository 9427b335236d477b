"""The engine's thread, and the new thread that replaces it when it hangs."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from typing import Protocol

from app.drive.compute_scheduler import ComputeScheduler
from app.engine.snapshot import Notice
from pipeline.common.watchdog import NETWORK, Stuck, Watchdog

_MOST_HANGS = 3
"""After this many hangs with one source, it is not tried again."""
_GIVES_UP = ". It keeps hanging: networks are off and playback is paused until a source is opened"

_SAID_S = 60.0
"""How long a notice about a hung worker is shown."""


def stuck_notice(stuck: Stuck, more: str, *, is_recording: bool) -> Notice:
    """The notice about a hung worker, for a minute; with ``more``, about what is disabled from now on, permanently."""
    goes_on = "; recording continues" if is_recording else ""
    text = f"{stuck.worker} hung for {stuck.seconds:.1f} s ({stuck.doing}) and was restarted{goes_on}"
    return trouble_notice(text + more, math.inf if more else _SAID_S)


def trouble_notice(text: str, for_s: float = _SAID_S) -> Notice:
    """An error that is shown for a minute, though frames follow it."""
    return Notice("error", text[0].upper() + text[1:], time.monotonic() + for_s)


class Say(Protocol):
    """Notifies users of a hung worker."""

    def __call__(self, stuck: Stuck, more: str = "") -> object:
        """more: additional text."""
        ...


class Takeovers:
    """Runs ``work(is_first)`` on its own thread, and again on another one if that hangs. ``wake`` makes a waiting
    worker check ``asked``.

    Recording continues meanwhile: the threads of the sensors and of the recorder are independent. If the hung thread
    continues later, it does nothing more (``pipeline.common.watchdog``).
    """

    def __init__(
        self,
        watchdog: Watchdog,
        work: Callable[[bool], None],
        say: Say,
        wake: Callable[[], object],
        turn: ComputeScheduler,
    ) -> None:
        self._watchdog, self._do, self._say, self._wake, self._turn = watchdog, work, say, wake, turn
        self._lock = threading.Lock()
        self._count, self._ended = 0, False
        self._is_asked = False
        self._last: Stuck | None = None
        self._hangs: Counter[str] = Counter()
        self.thread = self._fresh()

    @property
    def gives_up(self) -> bool:
        """Whether hangs keep recurring, so that networks must not run and playback must not continue."""
        return any(count >= _MOST_HANGS for count in self._hangs.values())

    @property
    def of_network(self) -> bool:
        """Whether the last hang was in a network."""
        return self._last is not None and self._last.doing.startswith(NETWORK)

    def asked(self) -> bool:
        """For the worker, true once per event: its helper hangs, so it must continue with new parts."""
        asked, self._is_asked = self._is_asked, False
        return asked

    def begin(self) -> None:
        self._watchdog.start()
        self.thread.start()

    def end(self, patience_s: float) -> None:
        """Start no other worker, and wait for the current one, unless it is the caller."""
        with self._lock:
            self._ended = True
        self._watchdog.stop()
        if self.thread.is_alive() and self.thread is not threading.current_thread():
            self.thread.join(patience_s)

    def forget(self) -> None:
        """Reset the count, since another source may work better."""
        self._hangs.clear()

    def watching_helper(self, name: str) -> AbstractContextManager[None]:
        """Context around the work of a helper thread for the current worker."""
        return self._watchdog.watching(name, partial(self._on_helper_stuck, self._count))

    def _fresh(self) -> threading.Thread:
        return threading.Thread(target=self._work, args=(self._count,), name="cipv-engine", daemon=True)

    def _work(self, count: int) -> None:
        with self._watchdog.watching("the engine", partial(self._on_stuck, count)):
            self._do(count == 0)

    def _on_stuck(self, count: int, stuck: Stuck) -> None:
        """Runs on the watchdog's thread."""
        with self._lock:
            if count != self._count or self._ended:
                return
            self._count += 1
            self._tell(stuck)
            self.thread = self._fresh()
            self.thread.start()

    def _on_helper_stuck(self, count: int, stuck: Stuck) -> None:
        """The worker itself is fine, or its own hang is detected separately on the same thread."""
        with self._lock:
            if count == self._count and not self._ended:
                self._tell(stuck)
                self._is_asked = True
        self._wake()

    def _tell(self, stuck: Stuck) -> None:
        self._last = stuck
        self._hangs[stuck.doing] += 1
        self._say(stuck, _GIVES_UP if self.gives_up else "")
        self._turn.leave_out(stuck.thread_id)
