"""Playback of a recording: in real time, by steps and by seeking.

Nothing is queued: late frames are skipped, and a seek is abandoned when a newer one arrives.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from app.core.control import Control, Wish
from app.core.playback_clock import PlaybackClock
from app.drive.background_runs import BackgroundRuns
from app.drive.open_recording import RunSetup
from app.engine.processed_frame import ProcessedFrame
from app.engine.read_ahead import ReadAhead
from app.engine.seekable_pipeline import SeekablePipeline
from app.engine.session_recording import SessionRecorder
from app.engine.snapshot import Snapshot
from pipeline.detection import Detectors
from pipeline.inference.cancellation import Stopped
from pipeline.params import Params
from pipeline.types.source import Source

_READ_PATIENCE_S = 1.0
"""A hanging read must not keep the program from exiting; its thread is a daemon."""


class RecordedPlayer:
    """A ``Player`` for one recording. ``setup`` defines how its whole drive is computed in the background, so that any
    frame is shown as in a complete run; None disables that. ``watching``: context around the read-ahead thread. Shown
    frames are passed to the session recorder."""

    live = False

    def __init__(
        self,
        pipeline: SeekablePipeline,
        control: Control,
        drives: BackgroundRuns,
        setup: RunSetup | None,
        recorder: SessionRecorder,
        watching: Callable[[], AbstractContextManager[object]] = nullcontext,
    ) -> None:
        self.source: Source = pipeline.source
        self.count = len(pipeline.source)
        self.duration_s = float(pipeline.timeline_s[-1])
        self.skipped = 0
        self._pipeline, self._setup = pipeline, setup
        self._control, self._drives, self._recorder = control, drives, recorder
        self._clock: PlaybackClock | None = None
        self._given_up: int | None = None
        self._ahead = ReadAhead(self._prepare, control.change, watching)

    def open(self, wish: Wish) -> None:
        if self._setup is not None:
            self._drives.open(self._setup, wish.params, wish.preset)
        else:
            self._drives.close()

    def successor(self, detectors: Detectors) -> None:
        """None: a newly created player can take over, since the frames remain available. Pending preparation is not
        waited for."""
        self._ahead.end()

    def close(self) -> None:
        self._ahead.end(_READ_PATIENCE_S)

    def wait_s(self, index: int) -> float | None:
        if self._clock is None:
            return self._drives.turn.rest_s if self._can_be_whole() else None
        left_s = self._clock.wait_s(index, time.monotonic())
        if self._ahead.busy and left_s <= 0:
            return None  # the worker is woken when the due frame is ready
        return left_s

    def wait(self, params: Params) -> None:
        """Returns at once: its frames are always available."""

    def serve(self, wish: Wish, shown: Snapshot) -> ProcessedFrame | None:
        processed = self._served(wish, shown)
        if processed is not None:
            if processed.whole:
                self._drives.offer(processed.frame)
            self._recorder.take(processed)
        if wish.settled:
            self._drives.want(wish.params, wish.preset)
        return processed

    def go_on(self, standing: Wish, index: int) -> None:
        if not standing.playing:
            self._clock = None
        elif self._clock is None or self._clock.speed != standing.speed:
            times = self._pipeline.timeline_s
            self._clock = PlaybackClock(times, time.monotonic(), float(times[index]), standing.speed)
        self._drives.turn.playing(self._clock is not None)
        if self._clock is not None:
            self._ahead.want(min(max(index + 1, self._clock.due(time.monotonic())), self.count - 1))

    def time_s(self, processed: ProcessedFrame) -> float:
        return float(self._pipeline.timeline_s[processed.frame.index])

    def health(self, shown: Snapshot) -> Snapshot:
        return shown

    def goes_on_after_failing(self) -> bool:
        self._clock = None
        return False

    # ------------------------------------------------------------ processing a request

    def _served(self, wish: Wish, shown: Snapshot) -> ProcessedFrame | None:
        index, last = shown.index, self.count - 1
        if wish.uri is not None or wish.target is not None:
            return self._seek(min(max(wish.target or 0, 0), last), wish, at_once=wish.uri is None)
        if wish.steps < 0:
            return self._seek(max(0, index + wish.steps), wish, at_once=True)
        if wish.steps > 0:
            return self._step(index, min(last, index + wish.steps), wish)
        if wish.params is not shown.params:
            return self._pipeline.rerun(wish.params)
        if wish.playing and shown.playing:
            return self._play(index, wish)
        return self._better(wish, shown)

    def _seek(self, index: int, wish: Wish, *, at_once: bool) -> ProcessedFrame | None:
        self._clock = self._given_up = None
        return self._pipeline.seek(index, wish.params, self._control.superseded, at_once=at_once)

    def _better(self, wish: Wish, shown: Snapshot) -> ProcessedFrame | None:
        """The paused frame again, if it can be improved: exact from the whole-drive run, or, after input stops, with a
        complete warm-up, which is aborted by any request."""
        if self._pipeline.can_be_exact():
            return self._pipeline.rerun(wish.params)
        turn = self._drives.turn
        if not self._can_be_whole() or turn.rest_s > 0:
            return None
        try:
            with turn.stoppable():
                return self._pipeline.seek(shown.index, wish.params, lambda: self._control.waiting)
        except Stopped:
            return None
        except BaseException:
            self._given_up = shown.index
            raise

    def _can_be_whole(self) -> bool:
        """Whether the frame was made for immediate display; an improvement that failed is not tried again."""
        processed = self._pipeline.shown
        return processed is not None and not processed.whole and processed.frame.index != self._given_up

    def _step(self, shown: int, index: int, wish: Wish) -> ProcessedFrame | None:
        """Process every frame up to ``index``, without skipping."""
        self._clock = None
        processed = None
        for i in range(shown + 1, index + 1):
            processed = self._pipeline.advance(i, wish.params)
        return processed

    def _play(self, index: int, wish: Wish) -> ProcessedFrame | None:
        """The next frame that is due and prepared, if any. Frames that are already late are skipped."""
        if self._clock is None:
            return None
        now = time.monotonic()
        if self._clock.wait_s(index, now) > 0:
            return None
        if index < self.count - 1:
            due, ready = self._clock.due(now), self._ahead.ready
            if ready is None or not index < ready <= due:
                self._ahead.want(due)
                return None
            self.skipped += ready - index - 1
            return self._pipeline.advance(ready, wish.params)
        if wish.loop:
            return self._seek(0, wish, at_once=False)
        self._control.change(playing=False)
        return None

    def _prepare(self, index: int) -> None:
        """Runs on the read-ahead thread."""
        with self._drives.turn.foreground():
            self._pipeline.prepare(index)
