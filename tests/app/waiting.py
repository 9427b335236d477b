"""Waiting for what tells nobody when it comes."""

from __future__ import annotations

import threading
from collections.abc import Callable

WAIT_S = 60.0


def wait_until(condition: Callable[[], bool], timeout_s: float = WAIT_S) -> bool:
    """Look again and again; false when it never came."""
    woken = threading.Event()
    for _ in range(round(timeout_s / 0.01)):
        if condition():
            return True
        woken.wait(0.01)
    return False
