"""The messages written so far, so that frames can refer to them."""

from __future__ import annotations

from collections import deque


class WrittenIndex:
    """The last ``keep`` values of one kind, each with the log time at which it was written. Values are compared by
    identity, because a sensor may send equal values twice."""

    def __init__(self, keep: int) -> None:
        self._values: deque[tuple[object, int]] = deque(maxlen=keep)

    def add(self, value: object, at_ns: int) -> None:
        self._values.append((value, at_ns))

    def log_time(self, value: object) -> int | None:
        """None if it was not written, or too long ago."""
        return next((at_ns for each, at_ns in reversed(self._values) if each is value), None)
