"""Recording beside the line: a thread of its own writes, and nothing ever waits for the disk.

What is put goes into a bounded queue. When the disk is too slow, what does not fit is dropped, counted, logged, and
noted in the session itself. A chunk goes to the system when it is full and at least every ``FLUSH_S``, and is forced to
the disk every ``SYNC_S``: death of the process costs a second at most, loss of power ``SYNC_S``.
"""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.params import Params
from pipeline.recording.packets import RawLidar
from pipeline.recording.segments import NEVER, Rotation, Segments
from pipeline.recording.writer import About
from pipeline.types import Frame, Result

logger = logging.getLogger("cipv.recording")

FLUSH_S, SYNC_S = 1.0, 5.0
_QUEUED = 64
"""Six seconds of frames at 10 Hz; with pictures of 1280×720 that is 200 MB at worst."""

_BATCH = 76
"""A VLP-16 sends about so many packets a rotation."""

_PATIENCE_S = 15.0
"""A disk that takes nothing for so long at the end is not waited for."""

_Job = Callable[[Segments], None]


@dataclass(frozen=True)
class RecordingState:
    """How a recording does. file: the newest of ``files``. seconds, bytes: over all of them. dropped: frames and
    batches of packets that did not fit. error: why it ended by itself, null while all is well."""

    file: Path
    files: tuple[Path, ...]
    frames: int
    seconds: float
    bytes: int
    dropped: int
    error: str | None

    def to_json(self) -> dict[str, Any]:
        """As the page and ``/api/recording`` read it."""
        return {
            "file": str(self.file),
            "frames": self.frames,
            "seconds": round(self.seconds, 3),
            "bytes": self.bytes,
            "dropped": self.dropped,
            "error": self.error,
        }


class Recorder:
    """Starts at once. BadInput when there is such a file already, OSError when it cannot be made. ``stop`` it in the
    end. ``queued``: how many frames may wait for the disk. ``raw_lidar``: ``put_packets`` instead of clouds. hangs:
    whether ``stop`` has given up on the disk."""

    def __init__(
        self,
        path: Path,
        about: About,
        rotation: Rotation = NEVER,
        *,
        queued: int = _QUEUED,
        raw_lidar: RawLidar | None = None,
    ) -> None:
        self._segments = Segments(path, about, rotation, "lz4", raw_lidar)
        self._jobs: queue.Queue[_Job | None] = queue.Queue(queued)
        self._lock = threading.Lock()
        self._taken, self._done = 0, 0
        self._marks: deque[tuple[int, str]] = deque()
        self._batch: list[tuple[int, bytes]] = []
        self._dropped = 0
        self._error: str | None = None
        self._ending = False
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
        """Record a frame, what was believed of it and with which parameters. Returns at once; false when it was
        dropped. received_ns: when a live frame was made, by its source's clock; null for one from a recording."""
        return self._put(lambda segments: segments.write(frame, result, params, received_ns=received_ns))

    def put_packets(self, packets: list[tuple[int, bytes]]) -> bool:
        """Record raw LiDAR packets, (when received in ns, payload) each, oldest first; best a sweep's at a time.
        Returns at once; false when they were dropped."""
        return self._put(lambda segments: segments.write_packets(packets))

    def put_packet(self, t_ns: int, payload: bytes) -> None:
        """Record a raw LiDAR packet; they are written a sweep's at a time. For one thread. t_ns: when it arrived."""
        self._batch.append((t_ns, payload))
        if len(self._batch) >= _BATCH:
            batch, self._batch = self._batch, []
            self.put_packets(batch)

    def mark(self, text: str) -> bool:
        """ "Something happened here", right after what was put last: never dropped. Returns at once; false when
        recording has ended by itself."""
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
            self._dropped,
            self._error,
        )

    def stop(self) -> RecordingState:
        """Write what is queued, close the file, and say how it went. Safe to call twice. A disk that hangs is waited
        for ``_PATIENCE_S``, and the error says so."""
        if self._thread.is_alive() and not self.hangs:
            if self._batch:
                batch, self._batch = self._batch, []
                self.put_packets(batch)
            self._ending = True
            with suppress(queue.Full):  # then the writer looks when it has written what is queued
                self._jobs.put_nowait(None)
            self._thread.join(_PATIENCE_S)
            if self._thread.is_alive():
                self.hangs = True
                kept = self._segments.kept_frames
                self._error = f"recording stopped: the disk does not answer; {kept} frames until then are kept"
                logger.error("%s: %s", self._segments.files[-1], self._error)
        return self.state

    def _put(self, job: _Job) -> bool:
        if self._error is not None:
            return False
        try:
            with self._lock:
                self._jobs.put_nowait(job)
                self._taken += 1
        except queue.Full:
            self._dropped += 1
            if self._dropped == 1:
                logger.warning("%s: the disk is too slow, frames are dropped", self._segments.files[-1])
            return False
        return True

    # ------------------------------------------------------------ the writer's thread

    def _work(self) -> None:
        try:
            self._write_all()
            self._segments.close()
        except Exception as error:
            with suppress(Exception):  # nothing to do for a file that can take no more; any other is closed as usual
                self._segments.close()
            self._fail(error)

    def _write_all(self) -> None:
        dropped = 0
        flushed_s = synced_s = time.monotonic()
        while True:
            try:
                job = self._jobs.get(timeout=FLUSH_S)
                if job is None:
                    return self._write_marks()
                job(self._segments)
                self._done += 1
            except queue.Empty:
                if self._ending:
                    return self._write_marks()
            self._write_marks()
            if self._dropped > dropped:
                self._segments.write_note(f"{self._dropped - dropped} frames were dropped here: the disk was too slow")
                dropped = self._dropped
            now_s = time.monotonic()
            if now_s - flushed_s >= FLUSH_S:
                is_due = now_s - synced_s >= SYNC_S
                self._segments.flush(to_disk=is_due)
                flushed_s, synced_s = now_s, now_s if is_due else synced_s

    def _write_marks(self) -> None:
        """Those whose frame is written."""
        while self._marks and self._marks[0][0] <= self._done:
            self._segments.write_mark(self._marks.popleft()[1])

    def _fail(self, error: Exception) -> None:
        """Recording ends here; the line goes on."""
        reason = (error.strerror if isinstance(error, OSError) else None) or f"{type(error).__name__}: {error}"
        with self._lock:
            self._error = f"recording stopped: {reason}; {self._segments.kept_frames} frames until then are kept"
        logger.error("%s: %s", self._segments.files[-1], self._error)
        while not self._jobs.empty():  # the frames that wait hold memory
            self._jobs.get_nowait()
