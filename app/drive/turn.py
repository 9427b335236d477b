"""Who may compute now: what a person waits for comes first, whole drives get the rest.

Both run Python, so a busy background thread would slow the shown frame down. It asks here before each piece of work
(one frame: some 5 ms, with a network 50) and waits while the foreground is at work. While a drive plays it works for a
short while right after each shown frame, when the next one is farthest: page and browser need the processor too.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

_SHARE_S = 0.03
"""Work for each frame that is played; a piece that was begun is finished."""
_LONGEST_WAIT_S = 0.3
_LONGEST_FRONT_S = 1.0
"""Work in front that never ends, as of sensors that tick faster than the line runs, slows the background down; it does
not stop it."""


class Turn:
    """Shared by one foreground thread and one background thread."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._in_front = 0
        self._served = 0
        self._playing = False
        self._ended = False
        self._spent_s = 0.0

    @contextmanager
    def foreground(self) -> Iterator[None]:
        """Work that goes first. Not for waiting: nobody else works meanwhile."""
        with self._condition:
            self._in_front += 1
        try:
            yield
        finally:
            with self._condition:
                self._in_front -= 1
                self._served += 1
                self._condition.notify_all()

    def playing(self, playing: bool) -> None:
        """Whether frames are being played now."""
        with self._condition:
            self._playing = playing
            self._condition.notify_all()

    def end(self) -> None:
        """Nobody waits here any more."""
        with self._condition:
            self._ended = True
            self._condition.notify_all()

    def wait(self, worked_s: float) -> None:
        """Background: wait until it may go on after a piece of work that took ``worked_s``."""
        with self._condition:
            self._spent_s += worked_s
            if self._spent_s >= _SHARE_S:
                self._spent_s, served = 0.0, self._served
                self._condition.wait_for(
                    lambda: self._ended or not self._playing or self._served > served, _LONGEST_WAIT_S
                )
            self._condition.wait_for(lambda: self._ended or not self._in_front, _LONGEST_FRONT_S)
