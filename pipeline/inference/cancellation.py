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
    """The run was cancelled. Nothing is wrong: the network can be asked again."""


class Terminates(Protocol):
    """The part of ``onnxruntime.RunOptions`` used here."""

    terminate: bool


class Cancellation:
    """Cancels what another thread runs: ``set`` ends the run under way in that thread's ``here`` block, and refuses
    further ones."""

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
        """Within the block, networks that this thread runs can be cancelled; they raise Stopped then."""
        before, _of_thread.stop = _of_thread.stop, self
        try:
            yield
        finally:
            _of_thread.stop = before

    @contextmanager
    def ends(self, run: Terminates) -> Iterator[None]:
        """For a runtime: ``run`` is the one to cancel while the block lasts."""
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
    """What cancels the networks that this thread runs; outside of a ``here`` block nothing does."""
    return _of_thread.stop or Cancellation()
