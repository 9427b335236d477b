"""What happened in a chaos soak, and what limits and measures processes."""

from __future__ import annotations

import contextlib
import re
import resource
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

JUMPS_S = (-86_400.0, -30.0, 30.0, 86_400.0)


@contextmanager
def limited(processes: list[int], limit: int, most: int) -> Iterator[None]:
    """Lower a resource limit of these processes, as far as they still exist."""
    before: dict[int, tuple[int, int]] = {}
    for process in processes:
        with contextlib.suppress(ProcessLookupError):
            before[process] = resource.prlimit(process, limit)
            resource.prlimit(process, limit, (most, before[process][1]))
    try:
        yield
    finally:
        for process, limits in before.items():
            with contextlib.suppress(ProcessLookupError):
                resource.prlimit(process, limit, limits)


def resident_mb(process: int) -> float:
    status = Path(f"/proc/{process}/status").read_text()
    return round(int(re.findall(r"VmRSS:\s+(\d+)", status)[0]) / 1024, 1)


@dataclass
class Figures:
    """Counts of everything that happened. ``wrong`` must stay empty."""

    befell: Counter[str] = field(default_factory=Counter)
    """Number of faults by kind."""
    acts: int = 0
    """Number of label changes that the server confirmed."""
    refused: int = 0
    """Number of changes that were rejected or not answered."""
    sessions: int = 0
    """Number of sessions that a recorder began, until it was killed or the disk was full."""
    frames: int = 0
    """Of these, read back."""
    drives: int = 0
    """Number of drives of which every final frame was compared."""
    clients: int = 0
    """Number of misbehaving clients."""
    live_ticks: int = 0
    """Number of ticks of live sensors that were shown."""
    live_frames: int = 0
    """Of these, how many were read back from the recording."""
    slowest_return_s: float = 0.0
    """Longest driving time from a check until every live sensor had delivered data again."""
    checks: int = 0
    wrong: list[str] = field(default_factory=list)
    resident_mb: list[float] = field(default_factory=list)
    """Memory of the server at each check."""
    live_resident_mb: list[float] = field(default_factory=list)
    """Memory of the process that shows and records live sensors, at each check."""
