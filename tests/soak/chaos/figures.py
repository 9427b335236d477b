"""What happened in a chaos soak, and what limits and measures processes."""

from __future__ import annotations

import contextlib
import re
import resource
import subprocess
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

_DESCRIPTORS = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
JUMPS_S = (-86_400.0, -30.0, 30.0, 86_400.0)


LimitName = Literal["nofile", "as", "fsize"]
"""As ``prlimit`` of util-linux names them: descriptors, address space, size of a file."""


@contextmanager
def limited(processes: list[int], limit: LimitName, most: int) -> Iterator[None]:
    """Lower a resource limit of these processes, as far as they still exist. As their own user: root is not allowed to
    in a container."""
    for process in processes:
        _limit(process, limit, f"{most}:")
    try:
        yield
    finally:
        for process in processes:
            _limit(process, limit, "unlimited:" if limit != "nofile" else f"{_DESCRIPTORS}:")


def _limit(process: int, limit: LimitName, value: str) -> None:
    with contextlib.suppress(FileNotFoundError):
        user = Path(f"/proc/{process}").stat().st_uid
        command = ["prlimit", f"--pid={process}", f"--{limit}={value}"]
        done = subprocess.run(command, user=user, capture_output=True, text=True)
        assert done.returncode == 0 or not Path(f"/proc/{process}").exists(), done.stderr


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
