"""Recording of the shown frames to a session, started and stopped by any client and fed by the engine."""

from __future__ import annotations

import math
import re
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from app.core.session_folder import SESSIONS
from app.engine.processed_frame import ProcessedFrame
from pipeline.common.errors import BadInput
from pipeline.types.source import AnySource, LiveSource, is_live_source

if TYPE_CHECKING:
    from pipeline.common.watchdog import Watchdog
    from pipeline.detection import Detectors
    from pipeline.recording.recorder import Recorder
    from pipeline.recording.recording_state import RecordingState


_LONGEST_NAME = 60


class SessionRecorder:
    """At most one recording at a time, of one source, into ``folder``. Any thread; ``take`` on the engine's.

    A recording contains what was shown: frames skipped at double speed or by seeking are left out. For live sensors it
    contains every tick that the pipeline processed, also while playback is paused, and every sweep, image, fix and own
    motion in between. A frame whose result is not exact yet waits, with its marks, for the exact one, until the next
    frame comes or recording ends.
    """

    def __init__(self, folder: Path = SESSIONS) -> None:
        self._folder = folder
        self.watchdog: Watchdog | None = None
        """Notices if a recording hangs."""
        self.on_change: Callable[[], object] = lambda: None
        """Called on any thread when a recording hangs, or ends by itself."""
        self._lock = threading.Lock()
        self._recorder: Recorder | None = None
        self._live: LiveSource | None = None
        self._feeding = threading.RLock()
        self._last: ProcessedFrame | None = None
        self._waits = False
        self._marks: list[str] = []

    @property
    def state(self) -> RecordingState | None:
        """None while nothing is recorded. A recording that ended by itself stays, with its error, until it is
        stopped."""
        recorder = self._recorder
        return recorder.state if recorder is not None else None

    def start(self, source: AnySource | None, detectors: Detectors | None = None) -> RecordingState:
        """Record from the next frame on; if a recording is already running, it continues. detectors: whose results are
        recorded.

        BadInput if nothing is open, or no file can be created.
        """
        with self._lock:
            if self._recorder is not None and self._recorder.state.error is None:
                return self._recorder.state
            self._end()
            if source is None:
                raise BadInput("nothing is open to record")
            # MCAP and its schemas take 0.2 s to import, so they are imported only when recording
            from pipeline.recording.recorder import Recorder
            from pipeline.recording.save import about

            try:
                recorder = Recorder(
                    new_session(self._folder, source.title),
                    about(source, detectors),
                    watchdog=self.watchdog,
                    on_change=lambda: self.on_change(),
                )
            except OSError as error:
                raise BadInput(f"{self._folder}: cannot record here: {error.strerror}") from None
            with self._feeding:
                self._live = source if is_live_source(source) else None
                self._last, self._recorder = None, recorder
            if self._live is not None:
                self._live.tap(recorder)
            return recorder.state

    def stop(self, within_s: float = math.inf) -> RecordingState | None:
        """End the recording, wait until it is written, and return its final state; None (and no file) if it is empty.
        within_s: see ``Recorder.stop``."""
        with self._lock:
            return self._end(within_s)

    def mark(self, text: str) -> bool:
        """Add a mark at the newest frame; false if nothing is being recorded."""
        with self._feeding:
            if self._recorder is None:
                return False
            if not self._waits:
                return self._recorder.mark(text)
            self._marks.append(text)
            return self._recorder.state.error is None

    def take(self, processed: ProcessedFrame) -> None:
        """Record a processed frame. A rerun with other parameters is not recorded again."""
        with self._feeding:
            recorder, last = self._recorder, self._last
            if recorder is None:
                return
            if last is not None and last.frame.t_ns == processed.frame.t_ns:
                if not self._waits or processed.params != last.params:
                    return
            else:
                self._write_waiting(recorder)
            self._last, self._waits = processed, True
            if processed.exact:
                self._write_waiting(recorder)

    def _write_waiting(self, recorder: Recorder) -> None:
        """Write the waiting frame, if any, with its current result."""
        if not self._waits or self._last is None:
            return
        processed, self._waits = self._last, False
        received_ns = self._live.now_ns() if self._live is not None else None
        recorder.put(processed.frame, processed.result, processed.params, received_ns=received_ns)
        marks, self._marks = self._marks, []
        for text in marks:
            recorder.mark(text)

    def _end(self, within_s: float = math.inf) -> RecordingState | None:
        if self._live is not None:
            self._live.tap(None)
        with self._feeding:
            recorder, self._recorder = self._recorder, None
            if recorder is not None:
                self._write_waiting(recorder)
            self._last = self._live = None
        if recorder is None:
            return None
        state = recorder.stop(within_s)
        if state.frames == 0 and not recorder.hangs:
            state.file.unlink(missing_ok=True)
            return None
        return state


def new_session(out: Path, title: str) -> Path:
    """``out`` itself if it names an MCAP file, else a file in that folder, named by title and local time."""
    if out.suffix.lower() == ".mcap":
        return out
    out.mkdir(parents=True, exist_ok=True)
    words = re.sub(r"\W+", "-", title, flags=re.ASCII).strip("-").lower()[:_LONGEST_NAME] or "session"
    name = f"{words}_{time.strftime('%Y%m%d-%H%M%S')}"
    path, number = out / f"{name}.mcap", 1
    while path.exists():
        number += 1
        path = out / f"{name}_{number}.mcap"
    return path
