"""Looks ahead of a drive's run: its networks process the images of frames that the run has not reached, in a process at
idle priority (``app.drive.look_ahead.process``), so that they cost the shown frame and the page nothing.

The results do not depend on it. Where the process is not ready, or gets no time beside other programs, or fails, the
run calls the networks itself, as with the embedded network.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from app.drive.compute_scheduler import ComputeScheduler
from app.drive.frame_inputs import without_pixels
from app.drive.look_ahead.client import NetworkProcess, ProcessEnded, is_worth_a_process
from app.drive.open_recording import OpenRecording
from pipeline.common.errors import first_line
from pipeline.common.files.user_files import Overloaded
from pipeline.common.watchdog import Stuck, Watchdog
from pipeline.detection import Detectors
from pipeline.types import Frame

logger = logging.getLogger("cipv.drive")

_WORTH_FRAMES = 100
"""With fewer unseen frames left, no process is started: its start takes as much processor time as the networks of four
to nine frames, and on a busy machine the process gets little else done before the drive is over. The 39 frames of Astyx
took 21 and 22 s with it and 13 and 22 s without, beside ten other programs on two cores."""
_PATIENT_S = 0.5
"""If an answer takes longer, other programs use the machine, and the run goes on without the process."""
_MOST_READY = 8
"""Frames that are looked at ahead of the run, if the memory for inputs is full."""
_MOST_ENDS = 3
"""After the process has ended unasked this many times, for example for lack of memory, a recording does without it."""


class LookAhead:
    """``begin`` for a recording; ``worth_waiting_s`` says whether the run should wait. on_progress: called on any
    thread after each frame. on_trouble: called on any thread with a sentence for users, without a full stop, when the
    process hangs or ends unasked. Any thread."""

    def __init__(
        self,
        turn: ComputeScheduler,
        on_progress: Callable[[], object],
        on_trouble: Callable[[str], object] = lambda text: None,
    ) -> None:
        self._turn, self._on_progress, self._on_trouble = turn, on_progress, on_trouble
        self._lock = threading.Lock()
        self._work: _Work | None = None
        self._ends: tuple[OpenRecording | None, int] = (None, 0)

    def begin(self, recording: OpenRecording, first: int, watchdog: Watchdog) -> None:
        """Look ahead in a recording from a frame on, unless that is done already, not worth it, or keeps failing."""
        with self._lock:
            if self._work is not None and self._work.recording is recording:
                return
            if self._ends[0] is not recording:
                self._ends = recording, 0
            if self._ends[1] >= _MOST_ENDS or not _is_worth_it(recording, first):
                return
            work = _Work(recording, first, self._turn, self._on_progress)
            old, self._work = self._work, work
        if old is not None:
            old.end()
        threading.Thread(target=self._do, args=(work, watchdog), name="cipv-look-ahead", daemon=True).start()

    def worth_waiting_s(self, recording: OpenRecording, index: int) -> float:
        """How long the run should wait for the detections of a frame, at most; 0 if it should not."""
        work = self._work
        return work.worth_waiting_s(index) if work is not None and work.recording is recording else 0.0

    def take(self, recording: OpenRecording, index: int) -> Frame | None:
        """A frame with its detections that is held for the run, once; None if the recording's inputs hold it, or if it
        is not ready."""
        work = self._work
        return work.take(index) if work is not None and work.recording is recording else None

    def end(self) -> None:
        """End the process, if any. An image in progress is dropped."""
        with self._lock:
            work, self._work, self._ends = self._work, None, (None, 0)
        if work is not None:
            work.end()

    def _do(self, work: _Work, watchdog: Watchdog) -> None:
        try:
            with watchdog.watching("the process for networks", lambda stuck: self._on_stuck(work, stuck)):
                work.do()
        except ProcessEnded:
            self._failed(work, "the process for networks ended unexpectedly")
        except Overloaded as error:
            self._failed(work, first_line(error), is_said=False)
        except Exception as error:
            self._failed(work, first_line(error), is_final=True, is_said=False)
        finally:
            work.close()
            self._on_progress()

    def _on_stuck(self, work: _Work, stuck: Stuck) -> None:
        work.end()
        self._failed(work, f"{stuck.worker} hung for {stuck.seconds:.1f} s ({stuck.doing})")

    def _failed(self, work: _Work, why: str, *, is_final: bool = False, is_said: bool = True) -> None:
        """The work ended before its time; it may begin again unless that was so often enough. is_said: false for what
        is wrong with a recording or a network, which the run meets and reports itself."""
        with self._lock:
            if self._work is not work:
                return
            self._work = None
            self._ends = work.recording, _MOST_ENDS if is_final else self._ends[1] + 1
            is_last = self._ends[1] >= _MOST_ENDS
        logger.warning("looking ahead in %s ended: %s", work.recording.setup.uri, why)
        if is_said:
            self._on_trouble(why + ("; the server runs the networks itself" if is_last else " and was restarted"))


class _Work:
    """The frames of one recording from ``first`` on."""

    def __init__(
        self, recording: OpenRecording, first: int, turn: ComputeScheduler, on_progress: Callable[[], object]
    ) -> None:
        self.recording = recording
        self._next, self._turn, self._on_progress = first, turn, on_progress
        self._process = NetworkProcess(recording.setup.detectors)
        self._ask = recording.detections()
        self._condition = threading.Condition()
        self._ready: dict[int, Frame] = {}
        self._has_ended = False
        self._is_slow = False
        self._since_s: float | None = None
        """Since when the current frame's networks have been running; None between frames."""

    def do(self) -> None:
        """Look at every frame. ProcessEnded if the process ends unasked; whatever a source raises."""
        detectors = self._process.detectors
        for index in range(self._next, self.recording.setup.total):
            if not self.recording.has_been_looked_at(index):
                self._look(index, detectors)
            with self._condition:
                self._next = index + 1
                self._condition.wait_for(lambda: self._has_ended or len(self._ready) < _MOST_READY)
                if self._has_ended:
                    return
            self._on_progress()

    def _look(self, index: int, detectors: Detectors) -> None:
        with self._turn.background(to_the_end=True):
            frame = self.recording.as_read(index)
        self._since_s = start_s = time.monotonic()
        try:
            seen = without_pixels(self.recording.look(frame, detectors, self._ask))
        finally:
            self._since_s = None
        with self._condition:
            self._is_slow = time.monotonic() - start_s > _PATIENT_S
            if not self.recording.has_been_looked_at(index):  # its memory for inputs is full
                self._ready[index] = seen

    def take(self, index: int) -> Frame | None:
        """A frame that is ready, once; earlier ones are dropped."""
        with self._condition:
            frame = self._ready.pop(index, None)
            self._ready = {at: each for at, each in self._ready.items() if at > index}
            self._condition.notify_all()
            return frame

    def worth_waiting_s(self, index: int) -> float:
        """How long to wait for a frame, at most."""
        if self._has_ended or self._is_slow or self._process.is_opening or index < self._next:
            return 0.0
        since_s = self._since_s
        return _PATIENT_S if since_s is None else max(0.0, since_s + _PATIENT_S - time.monotonic())

    def end(self) -> None:
        """Look at no more frames, and end the process. Any thread."""
        with self._condition:
            self._has_ended = True
            self._condition.notify_all()
        self._process.end()

    def close(self) -> None:
        """``end``, and release the pipes: for the thread that called ``do``."""
        self.end()
        self._process.close()


def _is_worth_it(recording: OpenRecording, first: int) -> bool:
    if not is_worth_a_process(recording.setup.detectors) or recording.setup.sensors == "lidar":
        return False
    unseen = sum(not recording.has_been_looked_at(index) for index in range(first, recording.setup.total))
    return unseen >= _WORTH_FRAMES
