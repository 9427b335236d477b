"""Shares the processor: interactive requests take priority, and runs over whole drives get the rest.

All threads share the processor, and Python, with page rendering. Background work therefore asks here before each piece
(one frame: about 5 ms, with networks 200). It waits while the foreground is busy and while a user is interacting, since
one request for a frame is usually followed by another; work that has started is stopped where possible. During playback
the background gets a share of the time, right after a frame was shown, when the next one is farthest away.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from pipeline.inference.cancellation import Cancellation

HAND_RESTS_S = 0.3
"""After this time without a request, the user is assumed to be waiting for nothing: by then the page has drawn the last
result, and a drag would have sent another request."""
_SHARE = 0.3
"""Share of the time given to background work during playback."""
_CREDIT_S = 0.03
"""Budget for one piece of background work during playback; a piece that overruns is completed, and the excess is
deducted from later ones."""
_LONGEST_WAIT_S = 0.3
"""Maximum wait for a shown frame during playback."""
_LONGEST_FRONT_S = 2.0
"""Continuous foreground work, as with sensors that tick faster than the pipeline runs, and continuous input slow down
background work but do not stop it."""


class ComputeScheduler:
    """Shared by foreground threads, background threads, and everything that makes requests."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._in_front: list[int] = []
        """Threads currently working in the foreground."""
        self._served = 0
        self._playing = False
        self._ended = False
        self._has_asked = False
        self._rests_at_s = time.monotonic()
        self._stops: set[Cancellation] = set()
        self._credit_s, self._credited_at_s = _CREDIT_S, time.monotonic()
        self._overdue_at_s: float | None = None

    # ------------------------------------------------------------ foreground

    def asked(self, *, rests: bool = False) -> None:
        """A user made a request: stoppable work yields at once. rests: the request is of a kind that usually does not
        repeat immediately. Any thread; does not block."""
        with self._condition:
            if not rests:
                self._has_asked = True
                self._rests_at_s = time.monotonic() + HAND_RESTS_S
            for stop in self._stops:
                stop.set()

    @property
    def rest_s(self) -> float:
        """Seconds until input is considered to have stopped."""
        return max(0.0, self._rests_at_s - time.monotonic())

    @contextmanager
    def foreground(self) -> Iterator[None]:
        """Work with priority. Must not contain waiting, because nothing else runs meanwhile."""
        thread_id = threading.get_ident()
        with self._condition:
            self._in_front.append(thread_id)
        try:
            yield
        finally:
            with self._condition:
                if thread_id in self._in_front:
                    self._in_front.remove(thread_id)
                self._served += 1
                if self._has_asked:
                    self._has_asked = False
                    self._rests_at_s = time.monotonic() + HAND_RESTS_S
                self._condition.notify_all()

    def leave_out(self, thread_id: int) -> None:
        """A foreground thread hangs and is no longer waited for."""
        with self._condition:
            self._in_front = [each for each in self._in_front if each != thread_id]
            self._condition.notify_all()

    @contextmanager
    def stoppable(self) -> Iterator[None]:
        """Networks that run in the block end with Stopped when a user makes a request."""
        stop = Cancellation()
        with self._condition:
            self._stops.add(stop)
        with self._until_done(stop):
            yield

    def playing(self, playing: bool) -> None:
        """Set whether frames are being played."""
        with self._condition:
            self._playing = playing
            self._condition.notify_all()

    def end(self) -> None:
        """Release all waiting threads."""
        with self._condition:
            self._ended = True
            for stop in self._stops:
                stop.set()
            self._condition.notify_all()

    # ------------------------------------------------------------ background

    @contextmanager
    def background(self, *, to_the_end: bool = False) -> Iterator[None]:
        """One piece of background work, once it may start. Its networks can be stopped, unless it has waited for too
        long. For one thread, which starts a stopped piece again. to_the_end: for other threads; never stopped."""
        stop = self._let_begin(to_the_end)
        began_s = time.monotonic()
        try:
            with self._until_done(stop):
                yield
            if not to_the_end:
                self._overdue_at_s = None  # after a stop, the waiting time counts from the first start
        finally:
            with self._condition:
                if self._playing:
                    self._credit_s -= time.monotonic() - began_s

    def _let_begin(self, to_the_end: bool) -> Cancellation:
        """Wait for permission to start. The cancellation is registered before any request can arrive."""
        stop = Cancellation()
        with self._condition:
            overdue_at_s = time.monotonic() + _LONGEST_FRONT_S
            if not to_the_end:
                overdue_at_s = self._overdue_at_s = self._overdue_at_s or overdue_at_s
            while not self._ended and (left_s := overdue_at_s - time.monotonic()) > 0:
                if self._in_front:
                    self._condition.wait(left_s)
                elif self.rest_s > 0:
                    self._condition.wait(min(self.rest_s, left_s))
                elif self._playing and not self._has_credit():
                    self._condition.wait_for(self._is_next_frame(), _LONGEST_WAIT_S)
                else:
                    self._stops |= set() if to_the_end else {stop}
                    break
        return stop

    def _is_next_frame(self) -> Callable[[], bool]:
        served = self._served
        return lambda: self._ended or not self._playing or self._served > served

    def _has_credit(self) -> bool:
        now_s = time.monotonic()
        self._credit_s = min(_CREDIT_S, self._credit_s + _SHARE * (now_s - self._credited_at_s))
        self._credited_at_s = now_s
        return self._credit_s > 0

    @contextmanager
    def _until_done(self, stop: Cancellation) -> Iterator[None]:
        try:
            with stop.here():
                yield
        finally:
            with self._condition:
                self._stops.discard(stop)
