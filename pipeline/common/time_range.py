"""The times that can be processed, in nanoseconds since 1970."""

from __future__ import annotations

END_OF_TIME_NS = 9_000_000_000_000_000_000
"""In the year 2255: nanoseconds no longer fit into 64 bits from 2262 on, and durations are added to times. A time in a
recording from then on is damaged."""


def is_time(t_ns: int) -> bool:
    """Whether a time from a file can be right."""
    return 0 <= t_ns < END_OF_TIME_NS
