"""A limit on the rate at which data are sent."""

from __future__ import annotations

import time
from collections.abc import Callable


class Pace:
    """Holds an average rate by waiting after each piece that was sent. For one thread.

    Args:
        bytes_per_s: the limit; None for none.
        clock: gives the time in seconds. sleep: waits so many seconds.
    """

    def __init__(
        self,
        bytes_per_s: float | None = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] = time.sleep,
    ) -> None:
        self._bytes_per_s, self._clock, self._sleep = bytes_per_s, clock, sleep
        self._begun_s = clock()

    def sending(self) -> None:
        """A piece is about to be sent."""
        self._begun_s = self._clock()

    def sent(self, count: int) -> None:
        """So many bytes were sent since then: wait until they are due. Time in which nothing was sent is not made up
        for, so that the rate is never above the limit for longer than a piece takes."""
        if self._bytes_per_s is not None:
            self._sleep(max(0.0, self._begun_s + count / self._bytes_per_s - self._clock()))
