"""One timeline for all live sensors: the host's clock as it stood at the start, counted on steadily.

Setting the host's clock moves nothing on it. Where a sensor's own clock lies on it is ``SensorClock``'s to say, from
when its messages arrive.
"""

from __future__ import annotations

import time

_LONGEST_AGE_NS = 1_000_000_000


class HostClock:
    """Nanoseconds since 1970, steady."""

    def __init__(self) -> None:
        self._unix_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        return time.monotonic_ns() + self._unix_ns

    def of_wall_ns(self, wall_ns: int) -> int:
        """A stamp that the system's clock gave within the last second, on this timeline; now where it did not."""
        age_ns = time.time_ns() - wall_ns
        return self.now_ns() - (age_ns if 0 <= age_ns <= _LONGEST_AGE_NS else 0)

    def ahead_ns(self) -> int:
        """How far the system's clock is ahead of this timeline by now: it was set in between."""
        return time.time_ns() - self.now_ns()
