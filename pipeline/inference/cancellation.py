"""Cancelling a network's run from another thread.

A run takes up to 0.2 s of every core and cannot yield by itself. The runtime checks between two layers whether it
should stop, so a run ends within milliseconds.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Stopped(Exception):
    """The run was cancelled. This is not an error: the network can be run again."""


class Terminates(Protocol):
    """The used part of ``onnxruntime.RunOptions``."""

    terminate: bool


class Cancellation:
    """Cancels runs of another thread: ``set`` ends the current run in that thread's ``here`` block, and refuses further
    ones."""

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
        """Within the block, networks run by this thread can be cancelled; they then raise Stopped."""
        before, _of_thread.stop = _of_thread.stop, self
        try:
            yield
        finally:
            _of_thread.stop = before

    @contextmanager
    def ends(self, run: Terminates) -> Iterator[None]:
        """For a runtime: ``run`` is the run to cancel during the block."""
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
    stop: Cancellation | None = None


_of_thread = _OfThread()


def of_this_thread() -> Cancellation:
    """The cancellation of networks run by this thread; outside a ``here`` block it is never set."""
    return _of_thread.stop or Cancellation()
