"""Records beside the pipeline: a separate thread writes, and nothing ever waits for the disk.

Frames, and messages that sensors send in between, go into a bounded queue. When the disk or the machine is too slow,
data that does not fit is dropped, counted by kind, logged, and noted in the session itself, with the cause. A chunk is
written when it is full and at least every ``FLUSH_S``, and is synced to disk every ``SYNC_S``: a crash of the process
costs at most a second, a power failure ``SYNC_S``.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path

from pipeline.common.watchdog import Stuck, Watchdog
from pipeline.params import Params
from pipeline.recording.recorder_thread import RecorderThread
from pipeline.recording.recording_state import RecordingState
from pipeline.recording.segments import NEVER, FileRotation, Segments
from pipeline.recording.session.provenance import About
from pipeline.recording.session.velodyne_scan import RawLidar
from pipeline.recording.write_queue import Do, JobKind, WriteJob, WriteQueue
from pipeline.types import EgoState, Frame, GnssFix, Result, Sweep
from pipeline.types.camera_shot import Shot

logger = logging.getLogger("cipv.recording")

_QUEUED = 64
"""Six seconds of frames at 10 Hz; with images of 1280×720 at most 200 MB."""
_UNPACKED_BYTES, _SMALL_BYTES = 3_000_000, 500
"""Queue size of an image from a camera that sends video, and of a sample of own motion or GNSS."""

_BATCH = 76
"""A VLP-16 sends about this many packets per rotation."""

_PATIENCE_S = 15.0
"""At the end, a disk that writes nothing for this long is not waited for. As long as it makes any progress, it is,
because a loaded machine may be slow."""

_MOST_HANGS = 3
"""After this many hangs, a recording ends: each leaves a thread and an open file behind."""
_TOLD_S = 60.0
"""How long a restart is shown."""
_DISK_HANGS = (
    "the disk does not respond. New data is kept in memory and written once it does; what does not fit is counted as "
    "lost"
)


class Recorder:
    """Starts at once; also a ``Tap`` for live sensors. BadInput if the file already exists, OSError if it cannot be
    created. Call ``stop`` at the end. ``queued``: how many frames may wait for the disk. ``raw_lidar``: record packets
    instead of clouds. watchdog: notices if writing hangs; on_change: called then, on its thread. hangs: whether
    ``stop`` has given up waiting for the disk.

    A thread that hangs in the disk goes on when that responds; one that hangs elsewhere is replaced by another, which
    continues in a new file.
    """

    def __init__(
        self,
        path: Path,
        about: About,
        rotation: FileRotation = NEVER,
        *,
        queued: int = _QUEUED,
        raw_lidar: RawLidar | None = None,
        watchdog: Watchdog | None = None,
        on_change: Callable[[], object] = lambda: None,
    ) -> None:
        segments = Segments(path, about, rotation, "lz4", raw_lidar)
        self._jobs = WriteQueue(queued)
        self._takes_packets = raw_lidar is not None
        self._batch: list[tuple[int, bytes]] = []
        self._watchdog, self._on_change = watchdog, on_change
        self._lock = threading.Lock()
        self._hangs = 0
        self._restarted: tuple[str, float] | None = None
        self._error: str | None = None
        self.hangs = False
        self._thread = RecorderThread(segments, self._jobs, self._on_failed)
        self._thread.start(watchdog, self._on_stuck)

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
            self._jobs.mark(text)
            return True

    @property
    def state(self) -> RecordingState:
        segments = self._thread.segments
        files = tuple(segments.files)
        return RecordingState(
            files[-1],
            files,
            segments.frames,
            segments.seconds,
            segments.bytes_written,
            self._jobs.dropped().total(),
            self._error,
            self._jobs.because,
            self._trouble(),
        )

    def stop(self, within_s: float = math.inf) -> RecordingState:
        """Write what is queued, close the file, and return the final state. Safe to call twice. What is still queued
        after ``within_s`` is dropped and noted. If writing hangs, gives up ``_PATIENCE_S`` after the last progress, and
        the error reports this."""
        self._jobs.ends_by_s = time.monotonic() + within_s
        if not self._thread.has_ended.is_set() and not self.hangs:
            if self._batch:
                batch, self._batch = self._batch, []
                self.put_packets(batch)
            self._jobs.end()
            if not self._ends():
                self.hangs = True
                what = "the disk does not respond" if self._waits_for_disk() else "its writer does not respond"
                self._end_with(what)
        return self.state

    def _ends(self) -> bool:
        """Wait until everything is written, or there was no progress for ``_PATIENCE_S``."""
        written = None
        while not (thread := self._thread).has_ended.is_set():
            if written == (now := (self._jobs.done, thread.segments.bytes_written)):
                return False
            written = now
            thread.has_ended.wait(_PATIENCE_S)
        return True

    def _put(self, do: Do, kind: JobKind, size: int = 0) -> bool:
        """Queue it, if there is room for one more of its kind, or for this many bytes of messages between frames."""
        if self._error is not None:
            return False
        is_queued = self._jobs.put(WriteJob(do, kind, size), self._thread.what_is_slow)
        if not is_queued and self._jobs.dropped().total() == 1:
            logger.warning("%s: %s, %s were dropped", self._file(), self._jobs.because, kind)
        return is_queued

    # ------------------------------------------------------------ what goes wrong

    def _on_stuck(self, stuck: Stuck) -> None:
        """Writing hangs: another thread takes over unless the disk itself does not respond. On the watchdog's
        thread."""
        fresh = self._thread.successor() if self._error is None else None
        if fresh is not None:
            self._hangs += 1
            if self._hangs > _MOST_HANGS:
                self._end_with("writing it keeps hanging")
                self._jobs.clear()
                self._thread.has_ended.set()
            else:
                text = f"the recorder hung for {stuck.seconds:.1f} s ({stuck.doing}) and continues in a new file"
                self._restarted = text, time.monotonic() + _TOLD_S
                self._thread = fresh
                fresh.start(self._watchdog, self._on_stuck)
        self._on_change()

    def _trouble(self) -> str | None:
        restarted = self._restarted
        if self._error is None and self._thread.hang is not None and self._waits_for_disk():
            return _DISK_HANGS
        return restarted[0] if restarted is not None and time.monotonic() < restarted[1] else None

    def _waits_for_disk(self) -> bool:
        return self._thread.segments.disk.is_waiting

    def _on_failed(self, error: BaseException) -> None:
        """Recording ends here; the pipeline continues."""
        self._end_with((error.strerror if isinstance(error, OSError) else None) or f"{type(error).__name__}: {error}")
        self._jobs.clear()
        self._on_change()

    def _end_with(self, reason: str) -> None:
        kept = self._thread.segments.kept_frames
        with self._lock:
            self._error = f"recording stopped: {reason}; the {kept} frames before are saved"
        logger.error("%s: %s", self._file(), self._error)

    def _file(self) -> Path:
        return self._thread.segments.files[-1]


def _bytes_of(sweep: Sweep) -> int:
    return sweep.points.nbytes + sweep.ring.nbytes + (sweep.time_s.nbytes if sweep.time_s is not None else 0)
