"""Recording what is shown: begun and ended by whoever asks, fed by the engine."""

from __future__ import annotations

import re
import threading
import time
from pathlib import Path

from app.line import Tick
from pipeline.errors import BadInput
from pipeline.recording.recorder import Recorder, RecordingState
from pipeline.recording.save import about
from pipeline.sources.base import AnySource, is_live_source

SESSIONS = Path(__file__).resolve().parent.parent / "sessions"
"""What this machine keeps: recordings, marks."""

_LONGEST_NAME = 60


class RecordingDesk:
    """At most one recording at a time, of one source, into ``folder``. Any thread; ``take`` on the engine's.

    A recording holds what was shown: playing a drive at double speed or seeking leaves out what was skipped. Of live
    sensors it holds every tick that the line ran, also while the page is paused.
    """

    def __init__(self, folder: Path = SESSIONS) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._recorder: Recorder | None = None
        self._is_live = False
        self._last: Tick | None = None

    @property
    def state(self) -> RecordingState | None:
        """Null while nothing is recorded. One that ended by itself stays, with its error, until it is stopped."""
        recorder = self._recorder
        return recorder.state if recorder is not None else None

    def start(self, source: AnySource | None) -> RecordingState:
        """Record from the next frame on; a recording that goes on already just goes on.

        BadInput when nothing is open, or no file can be made.
        """
        with self._lock:
            if self._recorder is not None and self._recorder.state.error is None:
                return self._recorder.state
            self._end()
            if source is None:
                raise BadInput("nothing is open that could be recorded")
            try:
                self._recorder = Recorder(new_session(self._folder, source.title), about(source))
            except OSError as error:
                raise BadInput(f"{self._folder}: no recording can be made: {error.strerror}") from None
            self._is_live, self._last = is_live_source(source), None
            return self._recorder.state

    def stop(self) -> RecordingState | None:
        """End the recording, wait until it is written, and say how it went; null (and no file) when it is empty."""
        with self._lock:
            return self._end()

    def mark(self, text: str) -> bool:
        """A mark right after the newest frame; false when nothing is recorded."""
        recorder = self._recorder
        if recorder is not None:
            recorder.mark(text)
        return recorder is not None

    def take(self, tick: Tick) -> None:
        """A tick that the line ran; the same frame again, with other parameters, is not recorded twice."""
        recorder, last = self._recorder, self._last
        if recorder is None or (last is not None and last.frame.t_ns == tick.frame.t_ns):
            return
        self._last = tick
        received_ns = time.time_ns() if self._is_live else None
        recorder.put(tick.frame, tick.result, tick.params, received_ns=received_ns)

    def _end(self) -> RecordingState | None:
        recorder, self._recorder, self._last = self._recorder, None, None
        if recorder is None:
            return None
        state = recorder.stop()
        if state.frames == 0:
            state.file.unlink(missing_ok=True)
            return None
        return state


def new_session(out: Path, title: str) -> Path:
    """``out`` itself when it names an MCAP file, else a file in that folder, named by title and local time."""
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
