"""The thread that writes a recording, and gives way to another one if it hangs."""

from __future__ import annotations

import queue
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress

from pipeline.common.watchdog import Stuck, Watchdog, at_work
from pipeline.recording.segments import Segments
from pipeline.recording.write_queue import Do, JobKind, WriteJob, WriteQueue

FLUSH_S, SYNC_S = 1.0, 5.0

DISK, BUSY, ENDED = "the disk was too slow", "the machine was too busy", "there was no time left to write them"
_HUNG = "the recorder hung"
_DISK_SHARE = 0.5
"""If the thread has spent more than this share of its time in writes and syncs since it last had nothing to do, the
disk is what it waits for; otherwise encoding and compressing have too little of a processor."""


class _Replaced(BaseException):
    """Another thread has taken over."""


class RecorderThread:
    """Writes what a queue holds, until the queue ends.

    Args:
        segments: where to.
        jobs: the queue.
        on_failed: called, on this thread, with what ended it.
    """

    def __init__(self, segments: Segments, jobs: WriteQueue, on_failed: Callable[[BaseException], object]) -> None:
        self.segments = segments
        self.hang: Stuck | None = None
        """The current operation if it hangs."""
        self.has_ended = threading.Event()
        self._jobs, self._on_failed = jobs, on_failed
        self._lock = threading.Lock()
        self._is_working, self._is_closing, self._is_replaced = False, False, False
        self._job: WriteJob | None = None
        self._again: deque[Do] | None = None
        self._unsaved: list[Do] = []
        self._noted: Counter[JobKind] = Counter()
        self._busy_since: tuple[float, float] | None = None

    def start(self, watchdog: Watchdog | None, on_stuck: Callable[[Stuck], object]) -> None:
        """on_stuck: called on the watchdog's thread once per operation that hangs."""

        def work() -> None:
            with watchdog.watching("the recorder", told, retires=False) if watchdog is not None else nullcontext():
                self._work()

        def told(stuck: Stuck) -> None:
            with self._lock:
                self.hang = stuck if self._is_working else None
            on_stuck(stuck)

        threading.Thread(target=work, name="cipv-recorder", daemon=True).start()

    def successor(self) -> RecorderThread | None:
        """A thread that continues in a new file, and writes there what is in no complete chunk of this one's. The job
        that hangs is dropped. None if this thread works after all, waits for the disk, or is closing its file: then it
        goes on."""
        with self._lock:
            if not self._is_working or self._is_closing or self.segments.disk.is_waiting:
                return None
            self._is_replaced = True
            if self._job is not None:
                self._jobs.drop(self._job.kind, _HUNG)
                self._jobs.done += 1
            fresh = RecorderThread(self.segments, self._jobs, self._on_failed)
            fresh._again, fresh._noted = deque((*self._unsaved, *(self._again or ()))), self._noted
            return fresh

    def what_is_slow(self) -> str:
        """Why the queue fills."""
        since = self._busy_since
        if since is None:
            return BUSY  # it has not even begun
        passed_s, waited_s = time.monotonic() - since[0], self.segments.disk.total_s() - since[1]
        return DISK if waited_s > _DISK_SHARE * passed_s else BUSY

    # ------------------------------------------------------------ on the thread

    def _work(self) -> None:
        try:
            if self._again is not None:
                with self._working("opening a file"):
                    self.segments = self.segments.continued()
                while self._again:
                    self._write(self._again.popleft(), "recording again")
            self._write_all()
            self._is_closing = True
            with self._working("closing the file"):
                self.segments.close()
        except _Replaced:
            self.segments.abandon()
        except BaseException as error:
            with suppress(Exception):  # nothing to do for a file whose writes fail; any other is closed as usual
                self.segments.close()
            self._on_failed(error)
        finally:
            self.has_ended.set()

    def _write_all(self) -> None:
        flushed_s = synced_s = time.monotonic()
        while True:
            if self._jobs.is_empty:
                self._busy_since = None
            try:
                job = self._jobs.take(FLUSH_S)
            except queue.Empty:
                pass
            else:
                if self._busy_since is None:
                    self._busy_since = time.monotonic(), self.segments.disk.total_s()
                if job is None:
                    break
                self._do(job)
            now_s = time.monotonic()
            if now_s > self._jobs.ends_by_s:
                continue
            self._write_marks()
            self._note_dropped()
            if now_s - flushed_s >= FLUSH_S:
                is_due = now_s - synced_s >= SYNC_S
                with self._working("saving a chunk"):
                    self.segments.flush(to_disk=is_due)
                self._unsaved.clear()
                flushed_s, synced_s = now_s, now_s if is_due else synced_s
        self._write_marks()
        self._note_dropped()

    def _do(self, job: WriteJob) -> None:
        if time.monotonic() > self._jobs.ends_by_s:
            self._jobs.drop(job.kind, ENDED)
        else:
            self._write(job.do, f"recording {job.kind}", job)
        self._jobs.done += 1

    def _write(self, do: Do, doing: str, job: WriteJob | None = None) -> None:
        before = self.segments.bytes_written
        with self._working(doing, job):
            do(self.segments)
        if self.segments.bytes_written > before:
            self._unsaved.clear()
        if self.segments.is_pending:
            self._unsaved.append(do)

    @contextmanager
    def _working(self, doing: str, job: WriteJob | None = None) -> Iterator[None]:
        """An operation that may hang. Raises _Replaced if it took so long that another thread has taken over."""
        with self._lock:
            self._is_working, self._job = True, job
        try:
            with at_work(doing):
                yield
        finally:
            with self._lock:
                self._is_working, self._job, self.hang = False, None, None
                is_replaced = self._is_replaced
            if is_replaced:
                raise _Replaced

    def _note_dropped(self) -> None:
        """Write a note about newly dropped items to the session."""
        dropped = self._jobs.dropped()
        since = dropped - self._noted
        if since:
            what = ", ".join(f"{count} {kind}" for kind, count in sorted(since.items()))
            because = self._jobs.because
            self._write(lambda segments: segments.write_note(f"{what} were dropped here: {because}"), "recording notes")
        self._noted = dropped

    def _write_marks(self) -> None:
        """Write the marks whose frame is written."""
        while (text := self._jobs.take_mark()) is not None:
            self._write(lambda segments, text=text: segments.write_mark(text), "recording marks")  # type: ignore[misc]
