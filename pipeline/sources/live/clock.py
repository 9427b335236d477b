"""One timeline for all live sensors: the host's clock at startup, continued monotonically.

Setting the host's clock does not affect it. ``SensorClock`` maps a sensor's own clock to it, from the arrival times of
its messages.
"""

from __future__ import annotations

import time

from pipeline.formats.velodyne import SensorClock

_LONGEST_AGE_NS = 1_000_000_000
_EARLIEST_NS, _LATEST_NS = 50_000_000, 100_000_000
_SET_AFTER_NS = 400_000_000


class HostClock:
    """Monotonic time in nanoseconds since 1970."""

    def __init__(self) -> None:
        self._unix_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        return time.monotonic_ns() + self._unix_ns

    def of_wall_ns(self, wall_ns: int) -> int:
        """Converts a timestamp of the system's clock from the last second to this timeline; the current time for
        others."""
        age_ns = time.time_ns() - wall_ns
        return self.now_ns() - (age_ns if 0 <= age_ns <= _LONGEST_AGE_NS else 0)

    def ahead_ns(self) -> int:
        """How far the system's clock is ahead of this timeline, because it was set in the meantime."""
        return time.time_ns() - self.now_ns()


class FollowedClock:
    """Tracks a sensor's own clock from the arrival times of its messages, also when the clock is set."""

    def __init__(self) -> None:
        self._own = SensorClock()
        self.jumps = 0
        """Number of times that it was set."""
        self._off_since_ns: int | None = None

    @property
    def offset_ms(self) -> float | None:
        """Host time minus the sensor's, including the shortest transmission delay; None before the first message."""
        return None if self._own.offset_ns is None else self._own.offset_ns / 1e6

    def to_host_ns(self, stamp_ns: int, arrived_ns: int) -> int:
        """Measurement time of a message that has just arrived. If messages arrive before they were made, or more than
        100 ms late, for 0.4 s continuously, they were not delayed; the sensor's clock was set."""
        self._own.observe(stamp_ns // 1000, arrived_ns)
        t_ns = self._own.to_ns(stamp_ns / 1000)
        if -_EARLIEST_NS <= arrived_ns - t_ns <= _LATEST_NS:
            self._off_since_ns = None
        elif self._off_since_ns is None:
            self._off_since_ns = arrived_ns
        elif arrived_ns - self._off_since_ns >= _SET_AFTER_NS:
            self._off_since_ns = None
            self.jumps += 1
            self._own.restart()
            self._own.observe(stamp_ns // 1000, arrived_ns)
            t_ns = self._own.to_ns(stamp_ns / 1000)
        return t_ns
