"""The log time of each message, which always increases, whatever the sensors' clocks do."""

from __future__ import annotations

_STEP_BACK_NS = 100_000_000
"""When header times jump back (two drives in one recording, a clock that was set), log time continues this much
later."""

_LAST_NS = 2**63 - 1


class SessionClock:
    """Returns log times that increase with every call. Deterministic for the same calls."""

    def __init__(self) -> None:
        self._last_ns = -1
        self._ahead_ns = 0
        """Offset added to header times so that they never go back."""

    def log_time(self, header_ns: int, received_ns: int | None = None) -> int:
        """Log time of a message: ``received_ns`` if given, else its header time, shifted after every jump back."""
        if received_ns is None:
            if header_ns + self._ahead_ns <= self._last_ns:
                self._ahead_ns = self._last_ns + _STEP_BACK_NS - header_ns
            received_ns = header_ns + self._ahead_ns
        self._last_ns = min(max(received_ns, self._last_ns + 1, 0), _LAST_NS)
        return self._last_ns

    def now(self) -> int:
        """A time directly after the last one, for messages without a time."""
        return self.log_time(0, self._last_ns + 1)
