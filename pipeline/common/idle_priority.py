"""Idle priority: for work that nobody waits for."""

from __future__ import annotations

import os
from contextlib import suppress

_NICEST = 19


def take_idle_priority() -> None:
    """Let this process compute only while no other program wants the processor: idle scheduling on Linux, the greatest
    niceness on other systems that have one.

    Only for a process of its own, before it starts threads. A thread among others must never call it: while it starves
    with Python's lock in its hands, they starve, too.
    """
    with suppress(OSError, AttributeError):  # a sandbox may refuse; Windows has no niceness
        os.nice(_NICEST)
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
