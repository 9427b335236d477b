"""The messages written so far, so that frames can refer to them."""

from __future__ import annotations

from collections import deque


class WrittenIndex:
    """The last ``keep`` values of one kind, each with the log time under which it was written. A value is known by
    what it is, not by what it equals: a sensor may say the same twice."""

    def __init__(self, keep: int) -> None:
        self._values: deque[tuple[object, int]] = deque(maxlen=keep)

    def add(self, value: object, at_ns: int) -> None:
        self._values.append((value, at_ns))

    def log_time(self, value: object) -> int | None:
        """None when it was not written, or too long ago."""
        return next((at_ns for each, at_ns in reversed(self._values) if each is value), None)
