"""Ending a network's run from another thread.

A run takes up to 0.2 s of every core, and cannot give way by itself. The runtime looks between two layers whether it is
to end: within some milliseconds.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Stopped(Exception):
    """Somebody ended it. Nothing is wrong: it can be asked again."""


class Terminates(Protocol):
    """As ``onnxruntime.RunOptions``."""

    terminate: bool


class Stop:
    """``set`` on any thread ends what runs, and refuses what would run, in the block of ``here`` on another."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._under_way: Terminates | None = None
        self._is_set = False

    @property
    def is_set(self) -> bool:
        return self._is_set

    def set(self) -> None:
        with self._lock:
            self._is_set = True
            if self._under_way is not None:
                self._under_way.terminate = True

    @contextmanager
    def here(self) -> Iterator[None]:
        """Networks that this thread asks in the block can be stopped: they raise Stopped then."""
        before, _of_thread.stop = _of_thread.stop, self
        try:
            yield
        finally:
            _of_thread.stop = before

    @contextmanager
    def ends(self, run: Terminates) -> Iterator[None]:
        """For a runtime: this is the run to end, while the block lasts."""
        with self._lock:
            if self._is_set:
                raise Stopped
            self._under_way = run
        try:
            yield
        finally:
            with self._lock:
                self._under_way = None


class _OfThread(threading.local):
    stop: Stop | None = None


_of_thread = _OfThread()


def of_this_thread() -> Stop:
    """What ends the networks that this thread asks; nobody sets it outside of such a block."""
    return _of_thread.stop or Stop()
