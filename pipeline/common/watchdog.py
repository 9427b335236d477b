"""Detects worker threads that hang: in a network, in a decoder, or in a file system that does not respond.

Each worker marks the start and end of a piece of work (``at_work``). Work counts as hung when it takes ``PATIENCE_S``
longer than it ever has; time in which the machine did not run the thread does not count. A thread that hangs in native
code cannot be killed. It is retired, that is left alone, and ends with ``Retired`` if it ever returns; the owner of the
worker starts a new one. Where a thread waits for a process, that process is also checked for being stopped or dead.
Code that hangs while it holds the GIL stops the watchdog too; a supervisor that polls ``/healthz`` notices that.
"""

from __future__ import annotations

import logging
import os
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

logger = logging.getLogger("cipv.watchdog")

PATIENCE_S = 1.0
FIRST_S = 30.0
"""Time limit for operations seen less than ``_FEWEST`` times: the first runs of a network allocate and compile."""
NETWORK = "the network "
"""Prefix of operations that are network runs."""
_FEWEST, _KEPT = 20, 2000
_LOOK_EVERY_S = 0.1
_STOPPED = ("T", "t", "Z", "X")
"""States of a process that does nothing until somebody else acts, in ``/proc/PID/stat``."""
_LATE_S = 0.5
"""If the watchdog itself is late by this much, the machine is busy or was suspended, and no worker is blamed."""


class Retired(BaseException):
    """Raised in a worker that was considered stuck, when it continues: a new one has taken over its work."""


@dataclass(frozen=True)
class Stuck:
    """A worker that is stuck."""

    worker: str
    """Its display name."""
    doing: str
    """The operation that does not end."""
    seconds: float
    """How long it has been running."""
    thread_id: int = 0
    """Id of the stuck thread."""


@dataclass(eq=False)
class _Heart:
    """State of a worker. doing: None while it waits for work."""

    name: str
    on_stuck: Callable[[Stuck], object]
    thread_id: int = field(default_factory=threading.get_ident)
    doing: str | None = None
    since_s: float = 0.0
    retired: bool = False
    native_id: int = field(default_factory=threading.get_native_id)
    process: int | None = None
    """The process that the current operation waits for; None if the thread does it itself."""
    first_s: float | None = None
    """Time limit of the current operation while its usual time is not known; None for the watchdog's own."""
    delayed_s: float | None = None
    """Time that whoever does the operation had waited for a processor at the last check; None before that, or if the
    system does not report it."""
    starved_s: float = 0.0
    """How much of the time since ``since_s`` that was."""
    stopped_s: float | None = None
    """When the process was first seen stopped or dead; None while it runs."""
    retires: bool = True
    """Whether it is retired once it is stuck."""
    is_told: bool = False
    """Whether it was reported that the current operation does not end."""


def waited_s(native_id: int) -> float | None:
    """Total time that a thread has waited for a processor (Linux); None if the system does not report it."""
    try:
        with open(f"/proc/self/task/{native_id}/schedstat", encoding="ascii") as file:
            return int(file.read().split()[1]) / 1e9
    except (OSError, ValueError, IndexError):
        return None


def process_waited_s(process: int) -> float | None:
    """Total time that the threads of a process have waited for a processor (Linux), that is more than the time that
    passed if several waited at once; None if the system does not report it."""
    try:
        files = list(Path(f"/proc/{process}/task").glob("*/schedstat"))
        return sum(int(file.read_text(encoding="ascii").split()[1]) for file in files) / 1e9 if files else None
    except (OSError, ValueError, IndexError):
        return None


def is_stopped(process: int) -> bool:
    """Whether a process of this user is stopped by a signal or a debugger, or has ended (Linux); false if the system
    does not report it. A process that waits for a processor is not stopped."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False
    return text.rpartition(")")[2].split()[0] in _STOPPED


def busy_share() -> float:
    """Excess load of the machine relative to its processors; time limits are extended accordingly. 0 if the system does
    not report it."""
    try:
        return os.getloadavg()[0] / (os.cpu_count() or 1)
    except (AttributeError, OSError):
        return 0.0


def _load() -> float:
    """By how much longer everything takes than on an idle machine."""
    return max(1.0, busy_share())


class _OfThread(threading.local):
    heart: _Heart | None = None
    watchdog: Watchdog | None = None


_of_thread = _OfThread()


@contextmanager
def at_work(doing: str, process: int | None = None, first_s: float | None = None) -> Iterator[None]:
    """Names this thread's current operation during the block; a nested block overrides the outer one. No effect on a
    thread that is not watched. Raises Retired if it took too long. process: the child process that does the operation,
    if the thread only waits for it. first_s: how long it may take until its usual time is known, if that is less than
    ``FIRST_S``."""
    heart, watchdog = _of_thread.heart, _of_thread.watchdog
    if heart is None or watchdog is None:
        yield
        return
    outer = heart.doing, heart.process, heart.first_s
    watchdog.begins(heart, doing, process, first_s)
    try:
        yield
    finally:
        watchdog.begins(heart, *outer)
        if heart.retired:
            raise Retired


class Watchdog:
    """Knows the current operation of every worker, and how long operations usually take. Any thread.

    Args:
        patience_s: how much longer than the longest time so far an operation may take.
        first_s: how long it may take while that is not known.
    """

    def __init__(self, patience_s: float = PATIENCE_S, first_s: float = FIRST_S) -> None:
        self._patience_s, self._first_s = patience_s, first_s
        self._lock = threading.Lock()
        self._hearts: set[_Heart] = set()
        self._took: dict[str, deque[tuple[float, float]]] = {}
        self._load = _load()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="cipv-watchdog", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._ended.set()

    @contextmanager
    def watching(self, name: str, on_stuck: Callable[[Stuck], object], *, retires: bool = True) -> Iterator[None]:
        """Registers this thread as a worker during the block. on_stuck: called once, on another thread, when the worker
        is stuck; from then on it is retired. retires: false for a worker that is only reported, once per operation, and
        goes on when the operation ends."""
        heart = _Heart(name, on_stuck, retires=retires)
        _of_thread.heart, _of_thread.watchdog = heart, self
        with self._lock:
            self._hearts.add(heart)
        try:
            yield
        except Retired:
            logger.warning("%s responds again, but has been replaced; it ends", name)
        finally:
            _of_thread.heart = _of_thread.watchdog = None
            with self._lock:
                self._hearts.discard(heart)

    def begins(
        self, heart: _Heart, doing: str | None, process: int | None = None, first_s: float | None = None
    ) -> None:
        """A worker begins an operation and has thereby ended the previous one. process, first_s: see ``at_work``."""
        now_s = time.monotonic()
        with self._lock:
            if heart.doing is not None:
                took = now_s - heart.since_s, self._load
                self._took.setdefault(heart.doing, deque(maxlen=_KEPT)).append(took)
            heart.doing, heart.since_s, heart.starved_s, heart.is_told = doing, now_s, 0.0, False
            heart.first_s = first_s
            if process != heart.process:
                heart.process, heart.delayed_s, heart.stopped_s = process, None, None

    def allowed_s(self, doing: str, process: int | None = None, first_s: float | None = None) -> float:
        """Time limit of an operation. What it took is extended only as far as the machine is busier now than it was
        then. A process at idle priority may not run for a while, and nobody waits for it, so it always has the time of
        a first run."""
        load, took = _load(), self._took.get(doing, ())
        if len(took) < _FEWEST or process is not None:
            return (self._first_s if first_s is None else min(first_s, self._first_s)) * load
        return max(took_s * max(1.0, load / load_then) for took_s, load_then in took) + self._patience_s * load

    def look(self, now_s: float, late_s: float = 0.0) -> list[Stuck]:
        """Retire stuck workers and call their callbacks. late_s: delay of this check."""
        found: list[tuple[_Heart, Stuck]] = []
        self._load = _load()
        with self._lock:
            for heart in self._hearts:
                if late_s > _LATE_S:
                    heart.since_s += late_s
                _count_starved(heart)
                if heart.doing is None or heart.is_told or heart.retired:
                    continue
                allowed_s = self.allowed_s(heart.doing, heart.process, heart.first_s)
                is_late = now_s - heart.since_s - heart.starved_s > allowed_s
                if not is_late and not self._has_stopped(heart, now_s, late_s):
                    continue
                heart.is_told = True
                heart.retired = heart.retires
                found.append((heart, Stuck(heart.name, heart.doing, now_s - heart.since_s, heart.thread_id)))
        for heart, stuck in found:
            logger.error("%s hangs (%s), for %.1f s so far\n%s", *_told(stuck), _stack(heart.thread_id))
            try:
                heart.on_stuck(stuck)
            except Exception:  # the watchdog continues if one callback fails
                logger.exception("%s could not be restarted", heart.name)
        return [stuck for _, stuck in found]

    def _has_stopped(self, heart: _Heart, now_s: float, late_s: float) -> bool:
        """Whether the process that a worker waits for has been stopped for ``patience_s``. Where this program was
        stopped with it, as by Ctrl-Z, it has that time again once both continue."""
        if heart.process is None or not is_stopped(heart.process):
            heart.stopped_s = None
            return False
        if heart.stopped_s is None or late_s > _LATE_S:
            heart.stopped_s = now_s
        return now_s - heart.stopped_s > self._patience_s

    def _watch(self) -> None:
        looked_s = time.monotonic()
        while not self._ended.wait(_LOOK_EVERY_S):
            now_s = time.monotonic()
            self.look(now_s, now_s - looked_s - _LOOK_EVERY_S)
            looked_s = now_s


def _count_starved(heart: _Heart) -> None:
    delayed_s = waited_s(heart.native_id) if heart.process is None else process_waited_s(heart.process)
    if delayed_s is not None and heart.delayed_s is not None:
        heart.starved_s += delayed_s - heart.delayed_s
    heart.delayed_s = delayed_s


def _told(stuck: Stuck) -> tuple[str, str, float]:
    return stuck.worker, stuck.doing, stuck.seconds


def _stack(thread_id: int) -> str:
    """Current stack of a thread."""
    frame = sys._current_frames().get(thread_id)
    return "".join(traceback.format_stack(frame)) if frame is not None else ""
