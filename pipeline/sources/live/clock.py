"""One timeline for all live sensors, and where each sensor's own clock lies on it.

The timeline is the host's clock as it stood at the start, counted on steadily: setting the host's clock moves nothing.
A sensor's stamp is mapped to it by an offset. What arrives is never early, only late, so the offset is the smallest
difference of arrival and stamp over the last seconds (Cristian's algorithm in one direction); what remains in it is
the shortest delay on the way.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

JUMP_NS = 100_000_000
"""Nothing arrives this much earlier than anything before it, unless its clock was set."""
LATE_NS = 500_000_000
"""What arrives later than this was held up, or its clock was set back."""
WITNESSES = 3
"""As many messages in a row must agree before a clock is taken as set anew: one may be damaged."""
_WINDOW_NS = 5_000_000_000


class HostClock:
    """Nanoseconds since 1970, steady."""

    def __init__(self) -> None:
        self._unix_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        return time.monotonic_ns() + self._unix_ns

    def of_wall_ns(self, wall_ns: int) -> int:
        """A stamp that the system's clock gave within the last second, on this timeline."""
        age_ns = min(max(0, time.time_ns() - wall_ns), 1_000_000_000)
        return self.now_ns() - age_ns

    def to_wall_ns(self, t_ns: int) -> int:
        """The system's clock, as it stands now, at a moment of this timeline."""
        return t_ns + time.time_ns() - self.now_ns()


@dataclass(frozen=True)
class ClockEstimate:
    """What is known of one sensor's clock. offset_ns: host minus sensor, null before the first message. wrap_ns: its
    stamps begin again after so long (a VLP-16's after an hour); null when they do not. jumps: how often it was set."""

    wrap_ns: int | None = None
    offset_ns: int | None = None
    jumps: int = 0
    _since_ns: int = 0
    _smallest_ns: int = 0
    _smallest_before_ns: int | None = None
    _suspects: tuple[int, ...] = ()

    def to_host_ns(self, t_sensor_ns: int, near_ns: int) -> int:
        """A sensor's stamp on the timeline; of a clock that wraps, the reading nearest to ``near_ns``."""
        return near_ns + _wrapped(t_sensor_ns + (self.offset_ns or 0) - near_ns, self.wrap_ns)


def follow(clock: ClockEstimate, t_sensor_ns: int, arrived_ns: int) -> ClockEstimate:
    """The estimate after one more message, stamped ``t_sensor_ns`` and arrived at ``arrived_ns`` of the timeline."""
    delta = _wrapped(arrived_ns - t_sensor_ns, clock.wrap_ns)
    if clock.offset_ns is None:
        return _started(clock, delta, arrived_ns)
    delta = clock.offset_ns + _wrapped(delta - clock.offset_ns, clock.wrap_ns)
    if not -JUMP_NS <= delta - clock.offset_ns <= LATE_NS:
        return _suspected(clock, delta, arrived_ns)
    if arrived_ns - clock._since_ns > _WINDOW_NS:
        before, smallest, since = clock._smallest_ns, delta, arrived_ns
    else:
        before, smallest, since = clock._smallest_before_ns, min(clock._smallest_ns, delta), clock._since_ns
    return replace(
        clock,
        offset_ns=smallest if before is None else min(smallest, before),
        _since_ns=since,
        _smallest_ns=smallest,
        _smallest_before_ns=before,
        _suspects=(),
    )


def _suspected(clock: ClockEstimate, delta: int, arrived_ns: int) -> ClockEstimate:
    """A message that does not fit: the clock was set if the next ones say the same."""
    suspects = (*clock._suspects, delta)[-WITNESSES:]
    if len(suspects) == WITNESSES and max(suspects) - min(suspects) < JUMP_NS:
        return _started(replace(clock, jumps=clock.jumps + 1), min(suspects), arrived_ns)
    return replace(clock, _suspects=suspects)


def _started(clock: ClockEstimate, delta: int, arrived_ns: int) -> ClockEstimate:
    return ClockEstimate(clock.wrap_ns, delta, clock.jumps, arrived_ns, delta)


def _wrapped(difference_ns: int, wrap_ns: int | None) -> int:
    """A difference of clock readings, between −wrap/2 and +wrap/2."""
    if wrap_ns is None:
        return difference_ns
    return (difference_ns + wrap_ns // 2) % wrap_ns - wrap_ns // 2
