"""Records beside the pipeline: a separate thread writes, and nothing ever waits for the disk.

Frames, and messages that sensors send in between, go into a bounded queue. When the disk or the machine is too slow,
data that does not fit is dropped, counted by kind, logged, and noted in the session itself, with the cause. A chunk is
written when it is full and at least every ``FLUSH_S``, and is synced to disk every ``SYNC_S``: a crash of the process
costs at most a second, a power failure ``SYNC_S``.
"""

from __future__ import annotations

import logging
import math
import queue
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Literal, NamedTuple

from pipeline.params import Params
from pipeline.recording.recording_state import RecordingState
from pipeline.recording.segments import NEVER, FileRotation, Segments
from pipeline.recording.session.provenance import About
from pipeline.recording.session.velodyne_scan import RawLidar
from pipeline.types import EgoState, Frame, GnssFix, Result, Sweep
from pipeline.types.camera_shot import Shot

logger = logging.getLogger("cipv.recording")

FLUSH_S, SYNC_S = 1.0, 5.0
_QUEUED = 64
"""Six seconds of frames at 10 Hz; with images of 1280×720 at most 200 MB."""
_QUEUED_BYTES = 200_000_000
"""For messages between frames; the JPEGs and clouds of ten seconds are 120 MB."""
_UNPACKED_BYTES, _SMALL_BYTES = 3_000_000, 500
"""Queue size of an image from a camera that sends video, and of a sample of own motion or GNSS."""

_BATCH = 76
"""A VLP-16 sends about this many packets per rotation."""

_PATIENCE_S = 15.0
"""At the end, a disk that writes nothing for this long is not waited for. As long as it makes any progress, it is,
because a loaded machine may be slow."""

_DISK, _BUSY, _ENDED = "the disk was too slow", "the machine was too busy", "there was no time left to write them"
_DISK_SHARE = 0.5
"""If the writer's thread has spent more than this share of its time in writes and syncs since it last had nothing to
do, the disk is what it waits for; otherwise encoding and compressing have too little of a processor."""

_Do = Callable[[Segments], None]
_Kind = Literal["frames", "packets", "sweeps", "images", "samples"]


class _Job(NamedTuple):
    do: _Do
    kind: _Kind
    bytes: int


class Recorder:
    """Starts at once; also a ``Tap`` for live sensors. BadInput if the file already exists, OSError if it cannot be
    created. Call ``stop`` at the end. ``queued``: how many frames may wait for the disk. ``raw_lidar``: record packets
    instead of clouds. hangs: whether ``stop`` has given up waiting for the disk."""

    def __init__(
        self,
        path: Path,
        about: About,
        rotation: FileRotation = NEVER,
        *,
        queued: int = _QUEUED,
        raw_lidar: RawLidar | None = None,
    ) -> None:
        self._segments = Segments(path, about, rotation, "lz4", raw_lidar)
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._queued, self._takes_packets = queued, raw_lidar is not None
        self._waiting: Counter[_Kind] = Counter()
        self._waiting_bytes = 0
        self._lock = threading.Lock()
        self._taken, self._done = 0, 0
        self._marks: deque[tuple[int, str]] = deque()
        self._batch: list[tuple[int, bytes]] = []
        self._dropped: Counter[_Kind] = Counter()
        self._because: str | None = None
        self._ends_by_s = math.inf
        self._busy_since: tuple[float, float] | None = None
        self._error: str | None = None
        self.hangs = False
        self._thread = threading.Thread(target=self._work, name="cipv-recorder", daemon=True)
        self._thread.start()

    def put(
        self,
        frame: Frame,
        result: Result | None = None,
        params: Params | None = None,
        *,
        received_ns: int | None = None,
    ) -> bool:
        """Record a frame, its result and its parameters. Returns at once; false if it was dropped. received_ns: when a
        live frame was made, by its source's clock; None for one from a recording."""
        return self._put(lambda segments: segments.write(frame, result, params, received_ns=received_ns), "frames")

    def put_packets(self, packets: list[tuple[int, bytes]]) -> bool:
        """Record raw LiDAR packets, (receive time in ns, payload) each, oldest first; preferably one sweep at a time.
        Returns at once; false if they were dropped."""
        return self._put(lambda segments: segments.write_packets(packets), "packets")

    # ------------------------------------------------------------ sensor messages, each on the sensor's thread

    def packet(self, payload: bytes, arrived_ns: int) -> None:
        """If packets are recorded, they are written one sweep at a time."""
        if not self._takes_packets:
            return
        self._batch.append((arrived_ns, payload))
        if len(self._batch) >= _BATCH:
            batch, self._batch = self._batch, []
            self.put_packets(batch)

    def sweep(self, sweep: Sweep, arrived_ns: int) -> None:
        """Records every sweep, not only those of frames; not needed if packets are recorded."""
        if not self._takes_packets:
            self._put(lambda segments: segments.write_sweep(sweep, arrived_ns), "sweeps", _bytes_of(sweep))

    def image(self, shot: Shot, t_ns: int, arrived_ns: int) -> None:
        """Records every image, not only those of frames."""
        size = len(shot.encoded) if shot.encoded is not None else _UNPACKED_BYTES
        self._put(lambda segments: segments.write_image(shot, t_ns, arrived_ns), "images", size)

    def ego(self, ego: EgoState, arrived_ns: int) -> None:
        self._put(lambda segments: segments.write_ego(ego, arrived_ns), "samples", _SMALL_BYTES)

    def fix(self, fix: GnssFix, arrived_ns: int) -> None:
        self._put(lambda segments: segments.write_fix(fix, arrived_ns), "samples", _SMALL_BYTES)

    # ------------------------------------------------------------

    def mark(self, text: str) -> bool:
        """A user's mark after the last item: never dropped. Returns at once; false if recording has ended by itself."""
        with self._lock:
            if self._error is not None:
                return False
            self._marks.append((self._taken, text))
            return True

    @property
    def state(self) -> RecordingState:
        segments = self._segments
        files = tuple(segments.files)
        return RecordingState(
            files[-1],
            files,
            segments.frames,
            segments.seconds,
            segments.bytes_written,
            self._dropped.total(),
            self._error,
            self._because,
        )

    def stop(self, within_s: float = math.inf) -> RecordingState:
        """Write what is queued, close the file, and return the final state. Safe to call twice. What is still queued
        after ``within_s`` is dropped and noted. If writing hangs, gives up ``_PATIENCE_S`` after the last progress, and
        the error reports this."""
        self._ends_by_s = time.monotonic() + within_s
        if self._thread.is_alive() and not self.hangs:
            if self._batch:
                batch, self._batch = self._batch, []
                self.put_packets(batch)
            self._jobs.put(None)
            if not self._ends():
                self.hangs = True
                kept = self._segments.kept_frames
                what = "the disk does not respond" if self._segments.disk.is_waiting else "its writer does not respond"
                self._error = f"recording stopped: {what}; the {kept} frames before are saved"
                logger.error("%s: %s", self._segments.files[-1], self._error)
        return self.state

    def _ends(self) -> bool:
        """Wait until everything is written, or there was no progress for ``_PATIENCE_S``."""
        written = None
        while self._thread.is_alive() and written != (now := (self._done, self._segments.bytes_written)):
            written = now
            self._thread.join(_PATIENCE_S)
        return not self._thread.is_alive()

    def _put(self, do: _Do, kind: _Kind, size: int = 0) -> bool:
        """Queue it, if there is room for one more of its kind, or for this many bytes of messages between frames."""
        if self._error is not None:
            return False
        with self._lock:
            has_room = self._waiting_bytes + size <= _QUEUED_BYTES if size else self._waiting[kind] < self._queued
            if has_room:
                self._jobs.put(_Job(do, kind, size))
                self._waiting[kind] += 1
                self._waiting_bytes += size
                self._taken += 1
            else:
                self._dropped[kind] += 1
                self._because = self._what_is_slow()
            is_first = not has_room and self._dropped.total() == 1
        if is_first:
            logger.warning("%s: %s, %s were dropped", self._segments.files[-1], self._because, kind)
        return has_room

    def _what_is_slow(self) -> str:
        since = self._busy_since
        if since is None:
            return _BUSY  # its thread has not even begun
        passed_s, waited_s = time.monotonic() - since[0], self._segments.disk.total_s() - since[1]
        return _DISK if waited_s > _DISK_SHARE * passed_s else _BUSY

    # ------------------------------------------------------------ the writer's thread

    def _work(self) -> None:
        try:
            self._write_all()
            self._segments.close()
        except Exception as error:
            with suppress(Exception):  # nothing to do for a file whose writes fail; any other is closed as usual
                self._segments.close()
            self._fail(error)

    def _write_all(self) -> None:
        noted: Counter[_Kind] = Counter()
        flushed_s = synced_s = time.monotonic()
        while True:
            if self._jobs.empty():
                self._busy_since = None
            try:
                job = self._jobs.get(timeout=FLUSH_S)
            except queue.Empty:
                pass
            else:
                if self._busy_since is None:
                    self._busy_since = time.monotonic(), self._segments.disk.total_s()
                if job is None:
                    break
                self._do(job)
            now_s = time.monotonic()
            if now_s > self._ends_by_s:
                continue
            self._write_marks()
            noted = self._note_dropped(noted)
            if now_s - flushed_s >= FLUSH_S:
                is_due = now_s - synced_s >= SYNC_S
                self._segments.flush(to_disk=is_due)
                flushed_s, synced_s = now_s, now_s if is_due else synced_s
        self._write_marks()
        self._note_dropped(noted)

    def _do(self, job: _Job) -> None:
        with self._lock:
            self._waiting[job.kind] -= 1
            self._waiting_bytes -= job.bytes
            has_time = time.monotonic() <= self._ends_by_s
            if not has_time:
                self._dropped[job.kind] += 1
                self._because = _ENDED
        if has_time:
            job.do(self._segments)
        self._done += 1

    def _note_dropped(self, noted: Counter[_Kind]) -> Counter[_Kind]:
        """Write a note about newly dropped items to the session. Returns the counts reported so far."""
        with self._lock:
            dropped = self._dropped.copy()
        since = dropped - noted
        if since:
            what = ", ".join(f"{count} {kind}" for kind, count in sorted(since.items()))
            self._segments.write_note(f"{what} were dropped here: {self._because}")
        return dropped

    def _write_marks(self) -> None:
        """Write the marks whose frame is written."""
        while self._marks and self._marks[0][0] <= self._done:
            self._segments.write_mark(self._marks.popleft()[1])

    def _fail(self, error: Exception) -> None:
        """Recording ends here; the pipeline continues."""
        reason = (error.strerror if isinstance(error, OSError) else None) or f"{type(error).__name__}: {error}"
        with self._lock:
            self._error = f"recording stopped: {reason}; the {self._segments.kept_frames} frames before are saved"
        logger.error("%s: %s", self._segments.files[-1], self._error)
        while not self._jobs.empty():  # the waiting frames hold memory
            self._jobs.get_nowait()


def _bytes_of(sweep: Sweep) -> int:
    return sweep.points.nbytes + sweep.ring.nbytes + (sweep.time_s.nbytes if sweep.time_s is not None else 0)
