"""Who may compute now: what a person waits for comes first, whole drives get the rest.

Both run Python, so a busy background thread would slow the shown frame down. It asks here before each piece of work
(one frame, some 5 ms, or one run of a network) and waits while the foreground is at work; while a drive plays it also
rests between pieces, because page and browser need the processor too.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

_REST_PLAYING = 2.0
"""Rest per time worked, while playing: a third of one core goes to the background."""
_LONGEST_REST_S = 0.2


class Turn:
    """Shared by one foreground thread and one background thread."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._in_front = 0
        self._playing = False
        self._ended = False

    @contextmanager
    def foreground(self) -> Iterator[None]:
        """Work that goes first."""
        with self._condition:
            self._in_front += 1
        try:
            yield
        finally:
            with self._condition:
                self._in_front -= 1
                self._condition.notify_all()

    def playing(self, playing: bool) -> None:
        """Whether frames are being played now."""
        with self._condition:
            if playing != self._playing:
                self._playing = playing
                self._condition.notify_all()

    def end(self) -> None:
        """Nobody waits here any more."""
        with self._condition:
            self._ended = True
            self._condition.notify_all()

    def wait(self, worked_s: float) -> None:
        """Background: wait until it may go on after a piece of work that took ``worked_s``."""
        rested_at = time.monotonic() + min(worked_s * _REST_PLAYING, _LONGEST_REST_S)
        with self._condition:
            while self._playing and not self._ended and (left_s := rested_at - time.monotonic()) > 0:
                self._condition.wait(left_s)
            self._condition.wait_for(lambda: self._ended or not self._in_front)
