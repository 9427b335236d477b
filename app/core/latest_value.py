"""Holds only the latest value, passed from a producer to one slower consumer thread."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

_T = TypeVar("_T")


class Newest(Generic[_T]):
    """A newer value replaces one that was not taken yet, so that the taker is never behind. Any thread."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._value: _T | None = None
        self._ended = False

    def put(self, value: _T) -> None:
        """Replace the value, taken or not."""
        with self._condition:
            self._value = value
            self._condition.notify_all()

    def put_back(self, value: _T) -> None:
        """What was taken and could not be used, unless a newer one is there."""
        with self._condition:
            if self._value is None:
                self.put(value)

    def take(self) -> _T | None:
        """Wait for a value; None at the end, whether or not one is left."""
        with self._condition:
            self._condition.wait_for(lambda: self._ended or self._value is not None)
            value, self._value = self._value, None
            return None if self._ended else value

    def end(self) -> None:
        """Wake whoever waits; from now on ``take`` gives None."""
        with self._condition:
            self._ended = True
            self._condition.notify_all()

    def ends_within(self, timeout_s: float) -> bool:
        """Wait so long, or until it has ended."""
        with self._condition:
            return self._condition.wait_for(lambda: self._ended, timeout_s)
