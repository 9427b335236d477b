"""The log time of each message, which always increases, whatever the sensors' clocks do."""

from __future__ import annotations

_STEP_BACK_NS = 100_000_000
"""Where header times jump back (two drives in one recording, a clock set), the session goes on this much later."""

_LAST_NS = 2**63 - 1


class SessionClock:
    """Gives log times that grow with every call. The same calls give the same times."""

    def __init__(self) -> None:
        self._last_ns = -1
        self._ahead_ns = 0
        """What is added to header times so that they never go back."""

    def log_time(self, header_ns: int, received_ns: int | None = None) -> int:
        """When a message came: ``received_ns`` where there is one, else its header time moved past every jump back."""
        if received_ns is None:
            if header_ns + self._ahead_ns <= self._last_ns:
                self._ahead_ns = self._last_ns + _STEP_BACK_NS - header_ns
            received_ns = header_ns + self._ahead_ns
        self._last_ns = min(max(received_ns, self._last_ns + 1, 0), _LAST_NS)
        return self._last_ns

    def now(self) -> int:
        """A time right after the last one, for what has no time of its own."""
        return self.log_time(0, self._last_ns + 1)
