"""Pauses Python's cyclic garbage collector.

A frame and a file import both create very many plain values without cycles. The collector examines all of them again
and again, which can take as long as the work itself, and finds nothing.
"""

from __future__ import annotations

import atexit
import gc
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

_COLLECT_AFTER = 5_000
"""More objects than one frame makes: reference counting frees those of a frame when the next result replaces it."""


class _Pause:
    """Counts the blocks that want a pause, so that it ends with the last one."""

    def __init__(self) -> None:
        self._lock, self._count, self._was_on = Lock(), 0, False

    def begin(self) -> None:
        with self._lock:
            if self._count == 0:
                self._was_on = gc.isenabled()
                gc.disable()
            self._count += 1

    def end(self) -> None:
        with self._lock:
            self._count -= 1
            if self._count == 0 and self._was_on:
                gc.enable()


_PAUSE = _Pause()


@contextmanager
def gc_paused() -> Iterator[None]:
    """No collection runs in any thread while the block lasts; for work of a few seconds. A collector that was off
    before stays off."""
    _PAUSE.begin()
    try:
        yield
    finally:
        _PAUSE.end()


def freeze_loaded_objects() -> None:
    """Exempt everything that exists now from collection. Modules and compiled kernels live as long as the process, and
    a full collection that walks through all of them takes 0.1 s, in the middle of a frame.

    Call it again after a large import. It does not collect first: imports leave only some tens of objects behind, and
    looking for them would add 0.06 s to every start."""
    gc.freeze()


def collect_rarely() -> None:
    """Set the collector up for a process that runs the pipeline: what is loaded is exempt, and a small collection runs
    only after more objects than a frame makes."""
    freeze_loaded_objects()
    atexit.register(gc.unfreeze)  # otherwise extension modules report leaks when the process ends
    gc.set_threshold(_COLLECT_AFTER, *gc.get_threshold()[1:])
