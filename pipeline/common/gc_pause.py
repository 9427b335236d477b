"""Python's collector of cycles, out of the way where a great many plain values are made: it looks at all of them again
and again, takes as long as the work itself, and finds nothing."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock


class _Pause:
    """Counts who wants it, so that it ends with the last."""

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
def uncollected() -> Iterator[None]:
    """No cycles are looked for meanwhile, in any thread: for work of seconds. Where it was off, it stays off."""
    _PAUSE.begin()
    try:
        yield
    finally:
        _PAUSE.end()
