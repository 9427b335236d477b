"""Detects whether something else used the machine during a benchmark: other processes, or other guests of its host."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

_STAT = Path("/proc/stat")
_IDLE, _IO_WAIT, _STEAL, _GUEST = 3, 4, 7, 8
"""Columns of the first line of /proc/stat, counted after its name. User time already includes guest time."""
NOTICEABLE = 0.10
"""Share of the machine's CPU time. On two idle cores, a desktop and its timers take less."""


@dataclass(frozen=True)
class CpuTimes:
    """CPU times of all cores together since the system started, in seconds."""

    total_s: float
    """All time, including idle time."""
    busy_s: float
    """Time in which a core was busy for this system."""
    stolen_s: float
    """Time in which a core was ready to run but the host ran something else (steal time)."""
    own_s: float
    """CPU time of this process and its finished children."""


def read_cpu_times() -> CpuTimes | None:
    """The times so far; None if the system does not provide them (Linux does)."""
    try:
        line = _STAT.read_text(encoding="ascii").splitlines()[0]
    except OSError:
        return None
    return parse_cpu_times(line, os.sysconf("SC_CLK_TCK"), sum(os.times()[:4]))


def parse_cpu_times(line: str, ticks_per_s: int, own_s: float) -> CpuTimes:
    """Parse the first line of /proc/stat."""
    ticks = [int(column) for column in line.split()[1:]][:_GUEST]
    total, stolen = sum(ticks), ticks[_STEAL]
    busy = total - ticks[_IDLE] - ticks[_IO_WAIT] - stolen
    return CpuTimes(total / ticks_per_s, busy / ticks_per_s, stolen / ticks_per_s, own_s)


def load_warning(before: CpuTimes | None, after: CpuTimes | None) -> str | None:
    """A sentence if others used a noticeable share of the machine between two readings; None otherwise, or if
    unknown."""
    if before is None or after is None or after.total_s <= before.total_s:
        return None
    span = after.total_s - before.total_s
    others = max(0.0, (after.busy_s - before.busy_s) - (after.own_s - before.own_s)) / span
    stolen = (after.stolen_s - before.stolen_s) / span
    if others + stolen < NOTICEABLE:
        return None
    return (
        f"the machine was not idle: other programs took {others:.0%} of its processor time, other guests of its host "
        f"{stolen:.0%}. Times are longer than on an idle machine; ratios to peers, measured alternately, still hold"
    )
