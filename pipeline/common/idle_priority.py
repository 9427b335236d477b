"""Idle priority, and other ways for a process to stand back: for work that nobody waits for."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

_NICEST = 19
_KILLED_FIRST = Path("/proc/self/oom_score_adj"), "1000"
_SESSION_NICENESS = Path("/proc/self/autogroup")
_THREADS = Path("/proc/self/task")


def take_idle_priority() -> None:
    """Let this process, with all its threads, compute only while no other program wants the processor: idle scheduling
    on Linux, the greatest niceness on other systems that have one.

    Only for a process of its own. A thread among others must never take it: while it starves with Python's lock in its
    hands, they starve, too. The process gets a session of its own: on a desktop, Linux shares processors between
    sessions first (autogroup), and then priorities count only within each.
    """
    with suppress(OSError, AttributeError):
        os.setsid()
        _SESSION_NICENESS.write_text(f"{_NICEST}\n", encoding="ascii")
    with suppress(OSError, AttributeError):  # a sandbox may refuse; Windows has no niceness
        os.nice(_NICEST)
    for thread in _threads():
        with suppress(OSError, AttributeError):
            os.setpriority(os.PRIO_PROCESS, thread, _NICEST)
            os.sched_setscheduler(thread, os.SCHED_IDLE, os.sched_param(0))


def be_killed_first() -> None:
    """If memory runs out, let the system end this process instead of the server (Linux)."""
    file, score = _KILLED_FIRST
    with suppress(OSError):
        file.write_text(score, encoding="ascii")


def _threads() -> list[int]:
    """Ids of this process's threads (Linux, where each has its own priority)."""
    try:
        return [int(each.name) for each in _THREADS.iterdir()]
    except OSError:
        return []
