"""Limits what a device may send, so that one that sends without end cannot take the program's time."""

from __future__ import annotations

import time
from collections.abc import Callable


class RateLimit:
    """Allows an amount per second on average, and that of one second at once. For one thread."""

    def __init__(self, per_s: float, now_s: Callable[[], float] = time.monotonic) -> None:
        self._per_s, self._now_s = per_s, now_s
        self._left, self._at_s = per_s, now_s()

    def allows(self, amount: float) -> bool:
        """Whether this much more is allowed now. What is not allowed does not count."""
        now_s = self._now_s()
        self._left = min(self._per_s, self._left + (now_s - self._at_s) * self._per_s)
        self._at_s = now_s
        if amount > self._left:
            return False
        self._left -= amount
        return True
