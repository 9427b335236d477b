"""How long a thread has waited for the disk, to tell a slow disk from a machine without a processor to spare."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from pipeline.common.watchdog import at_work

RESPONDS_WITHIN_S = 5.0
"""Time limit of the first writes and syncs. What is synced was collected within this time (``SYNC_S`` of the recorder),
so a disk that needs longer cannot keep up, and loses data soon."""


class DiskTime:
    """Counts the time that one thread spends in writes and syncs; any thread may ask."""

    def __init__(self) -> None:
        self._ended_s = 0.0
        self._since_s: float | None = None

    @contextmanager
    def waiting(self, doing: str = "writing to the disk") -> Iterator[None]:
        """The thread waits for the disk during the block. doing: for the watchdog."""
        begun_s = self._since_s = time.monotonic()
        try:
            with at_work(doing, first_s=RESPONDS_WITHIN_S):
                yield
        finally:
            self._since_s = None
            self._ended_s += time.monotonic() - begun_s

    @property
    def is_waiting(self) -> bool:
        return self._since_s is not None

    def total_s(self) -> float:
        """So far, with the wait under way, however long that lasts already."""
        since_s = self._since_s
        return self._ended_s + (time.monotonic() - since_s if since_s is not None else 0.0)
