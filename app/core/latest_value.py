"""Holds only the latest value, passed from a producer to one slower consumer thread."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

_T = TypeVar("_T")


class Newest(Generic[_T]):
    """Holds one value. A newer value replaces one that was not taken yet, so that the consumer never lags behind. Any
    thread."""

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
        """Put back a value that was taken but could not be used, unless there is a newer one."""
        with self._condition:
            if self._value is None:
                self.put(value)

    def take(self) -> _T | None:
        """Wait for a value; None after the end, even if a value is left."""
        with self._condition:
            self._condition.wait_for(lambda: self._ended or self._value is not None)
            value, self._value = self._value, None
            return None if self._ended else value

    def end(self) -> None:
        """Wake all waiting threads; from now on ``take`` returns None."""
        with self._condition:
            self._ended = True
            self._condition.notify_all()

    def ends_within(self, timeout_s: float) -> bool:
        """Wait for this time or until ``end`` is called; returns whether it was."""
        with self._condition:
            return self._condition.wait_for(lambda: self._ended, timeout_s)
