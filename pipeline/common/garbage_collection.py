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
"""More than the objects made in one frame; reference counting frees those when the next result replaces this one."""

_FROZEN: set[str] = set()


class _Pause:
    """Counts nested and concurrent pauses, so that collection resumes when the last one ends."""

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
    """Disable garbage collection in all threads during the block, for work of a few seconds. If collection was disabled
    before, it stays disabled."""
    _PAUSE.begin()
    try:
        yield
    finally:
        _PAUSE.end()


def freeze_loaded_objects(loaded: str) -> None:
    """Exempt all existing objects from collection. Modules and compiled kernels live as long as the process, and a full
    collection that traverses them takes 0.1 s in the middle of a frame.

    loaded: what has just been imported, which happens once in a process. Only the first call with it has an effect: a
    second one would exempt whatever else exists by then, such as a closed server with its images, for good. It does not
    collect first: imports leave only a few dozen unreachable objects, and finding them would add 0.06 s to every start.
    """
    if loaded not in _FROZEN:
        _FROZEN.add(loaded)
        gc.freeze()


def collect_less_often() -> None:
    """A generation-0 collection runs only after more allocations than one frame makes. At the beginning of a program:
    while modules are imported, the collector takes a tenth of the time and finds nothing."""
    gc.set_threshold(_COLLECT_AFTER, *gc.get_threshold()[1:])


def collect_rarely() -> None:
    """Configure the collector for a process that runs the pipeline: loaded objects are exempt, others looked at less
    often."""
    freeze_loaded_objects("pipeline")
    atexit.register(gc.unfreeze)  # otherwise extension modules report leaks at exit
    collect_less_often()
