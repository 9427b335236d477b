"""What waits to be recorded: bounded, so that nobody waits for a disk, and what does not fit is counted by kind."""

from __future__ import annotations

import math
import queue
import threading
from collections import Counter, deque
from collections.abc import Callable
from typing import Literal, NamedTuple

from pipeline.recording.segments import Segments

QUEUED_BYTES = 200_000_000
"""For messages between frames; the JPEGs and clouds of ten seconds are 120 MB."""

Do = Callable[[Segments], None]
JobKind = Literal["frames", "packets", "sweeps", "images", "samples"]


class WriteJob(NamedTuple):
    """Something to write."""

    do: Do
    """Writes it."""
    kind: JobKind
    """What is counted if it is dropped."""
    bytes: int
    """Size of a message between frames; 0 for what is counted by number."""


class WriteQueue:
    """Jobs in order, and marks between them. Any thread puts, one takes. most: frames, and batches of packets, that may
    wait."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._jobs: queue.SimpleQueue[WriteJob | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self.waiting: Counter[JobKind] = Counter()
        """Jobs by kind."""
        self._waiting_bytes = 0
        self._taken = 0
        self.done = 0
        """Jobs that were written or dropped."""
        self._marks: deque[tuple[int, str]] = deque()
        self._dropped: Counter[JobKind] = Counter()
        self.because: str | None = None
        """Why data was last dropped."""
        self.ends_by_s = math.inf
        """What is not written by this ``time.monotonic`` is dropped."""

    @property
    def is_empty(self) -> bool:
        return self._jobs.empty()

    def put(self, job: WriteJob, why: Callable[[], str]) -> bool:
        """Queue it, if there is room for one more of its kind, or for its bytes; else count it as dropped. why: asked
        for the cause."""
        with self._lock:
            if job.bytes:
                has_room = self._waiting_bytes + job.bytes <= QUEUED_BYTES
            else:
                has_room = self.waiting[job.kind] < self._most
            if has_room:
                self._jobs.put(job)
                self.waiting[job.kind] += 1
                self._waiting_bytes += job.bytes
                self._taken += 1
            else:
                self._dropped[job.kind] += 1
                self.because = why()
        return has_room

    def end(self) -> None:
        """No more jobs follow."""
        self._jobs.put(None)

    def take(self, within_s: float) -> WriteJob | None:
        """The next job; None after the last one. queue.Empty if there is none in time."""
        job = self._jobs.get(timeout=within_s)
        if job is not None:
            with self._lock:
                self.waiting[job.kind] -= 1
                self._waiting_bytes -= job.bytes
        return job

    def drop(self, kind: JobKind, because: str) -> None:
        """Count a job that was taken, but could not be written."""
        with self._lock:
            self._dropped[kind] += 1
            self.because = because

    def dropped(self) -> Counter[JobKind]:
        """By kind, since the beginning."""
        with self._lock:
            return self._dropped.copy()

    def mark(self, text: str) -> None:
        """A mark after the last job: never dropped."""
        with self._lock:
            self._marks.append((self._taken, text))

    def take_mark(self) -> str | None:
        """The next mark if everything before it is done."""
        if self._marks and self._marks[0][0] <= self.done:
            return self._marks.popleft()[1]
        return None

    def clear(self) -> None:
        """Discard what waits, since it holds memory."""
        while not self._jobs.empty():
            self._jobs.get_nowait()
