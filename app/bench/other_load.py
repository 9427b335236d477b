"""Detects whether something else used the machine during a benchmark: other processes, or other guests of its host."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

_STAT = Path("/proc/stat")
_IDLE, _IO_WAIT, _STEAL, _GUEST = 3, 4, 7, 8
"""Columns of /proc/stat's first line, after its name; guest time is counted in user time already."""
NOTICEABLE = 0.10
"""Share of the machine: on two idle cores, a desktop and its timers take less."""


@dataclass(frozen=True)
class CpuTimes:
    """Seconds since the system began, of all cores together."""

    total_s: float
    """All time, idle too."""
    busy_s: float
    """Time in which a core computed for this system."""
    stolen_s: float
    """Time in which a core wanted to compute and the host computed something else."""
    own_s: float
    """Time that this process and its ended children computed."""


def read_cpu_times() -> CpuTimes | None:
    """The times so far; None where the system does not tell them (it does on Linux)."""
    try:
        line = _STAT.read_text(encoding="ascii").splitlines()[0]
    except OSError:
        return None
    return parse_cpu_times(line, os.sysconf("SC_CLK_TCK"), sum(os.times()[:4]))


def parse_cpu_times(line: str, ticks_per_s: int, own_s: float) -> CpuTimes:
    """From the first line of /proc/stat."""
    ticks = [int(column) for column in line.split()[1:]][:_GUEST]
    total, stolen = sum(ticks), ticks[_STEAL]
    busy = total - ticks[_IDLE] - ticks[_IO_WAIT] - stolen
    return CpuTimes(total / ticks_per_s, busy / ticks_per_s, stolen / ticks_per_s, own_s)


def load_warning(before: CpuTimes | None, after: CpuTimes | None) -> str | None:
    """A sentence when others took a noticeable share of the machine between two readings; None when not, or unknown."""
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
