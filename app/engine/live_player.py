"""Live sensors in the dashboard: the pipeline runs whether or not a page is open."""

from __future__ import annotations

import time
from dataclasses import replace

from app.core.control import Control, Wish
from app.drive.background_runs import BackgroundRuns
from app.engine.live_pipeline import LivePipeline
from app.engine.processed_frame import ProcessedFrame
from app.engine.session_recording import SessionRecorder
from app.engine.snapshot import Snapshot
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.types import Frame
from pipeline.types.source import LiveSource

_WAIT_S = 0.02
"""How long it waits for a tick before the worker checks for new requests."""
_HEALTH_EVERY_S = 0.5


class LivePlayer:
    """A ``Player`` for live sensors. While paused, the shown tick is kept and can be rerun with other parameters;
    resuming jumps to the present. Every tick is passed to the recorder, shown or not."""

    live = True
    count = 0
    duration_s = 0.0

    def __init__(
        self, pipeline: LivePipeline, control: Control, drives: BackgroundRuns, recorder: SessionRecorder
    ) -> None:
        self._pipeline, self._control, self._drives, self._recorder = pipeline, control, drives, recorder
        self._came: Frame | None = None
        self._health_told_s = 0.0

    def successor(self, detectors: Detectors) -> LivePlayer:
        """Takes over from a hanging player; the sensors stay open."""
        return LivePlayer(self._pipeline.successor(detectors), self._control, self._drives, self._recorder)

    @property
    def source(self) -> LiveSource:
        return self._pipeline.source

    @property
    def skipped(self) -> int:
        return self._pipeline.source.dropped

    def open(self, wish: Wish) -> None:
        """Shows ticks from the first one on."""
        self._drives.close()
        self._pipeline.open()
        self._control.change(playing=True)

    def close(self) -> None:
        self._pipeline.close()

    def wait_s(self, index: int) -> float | None:
        return 0.0  # it waits for its sensors instead

    def wait(self, params: Params) -> None:
        self._came = self._pipeline.wait(params, _WAIT_S)

    def serve(self, wish: Wish, shown: Snapshot) -> ProcessedFrame | None:
        if self._came is not None:
            came, self._came = self._came, None
            self._recorder.take(self._pipeline.run(came, wish.params))
        held, newest = shown.processed, self._pipeline.newest
        is_behind = newest is not None and (held is None or newest.frame is not held.frame)
        if wish.playing and is_behind:
            return newest
        if held is not None and wish.params is not shown.params:
            return held.rerun(wish.params)
        return None

    def go_on(self, standing: Wish, index: int) -> None:
        """Nothing to prepare: there is no drive computed in the background."""
        self._drives.turn.playing(False)

    def time_s(self, processed: ProcessedFrame) -> float:
        return self._pipeline.time_s(processed)

    def health(self, shown: Snapshot) -> Snapshot:
        now_s = time.monotonic()
        if now_s - self._health_told_s <= _HEALTH_EVERY_S:
            return shown
        self._health_told_s = now_s
        return replace(shown, streams=self.source.health(), notices=self._pipeline.with_silence(shown.notices))

    def goes_on_after_failing(self) -> bool:
        """The next tick may succeed."""
        return True
