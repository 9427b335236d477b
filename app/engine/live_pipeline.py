"""The pipeline on live sensors: each tick is processed at most once, and only the newest.

Seeking is not possible. Ticks that are not processed in time are dropped, so the shown data is as recent as the sensors
and the pipeline allow. Not thread-safe.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from time import monotonic, perf_counter

from app.engine.processed_frame import ProcessedFrame
from app.engine.snapshot import Notice
from pipeline.common.watchdog import NETWORK, at_work
from pipeline.detection import Detectors, Detects, Seen
from pipeline.live_detection import LiveDetectors
from pipeline.params import Params
from pipeline.run import Sensors, advance, used
from pipeline.sources.live.health import not_delivering
from pipeline.step import State
from pipeline.types import U8, Frame
from pipeline.types.source import LiveSource

_SILENCE_S = 1.0
"""Without a tick for this long, the page lists the sensors that deliver nothing."""


class LivePipeline:
    """``open`` the sensors, then repeatedly ``wait`` for a frame and ``run`` it; finally ``close``. watching: a context
    around the work of a thread beside it."""

    def __init__(
        self,
        source: LiveSource,
        detectors: Detectors,
        sensors: Sensors,
        watching: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self.source = source
        self.newest: ProcessedFrame | None = None
        """The last processed tick."""
        self._ask = _TimedLook()
        self._detectors = LiveDetectors(detectors, watching, self._ask)
        self._sensors, self._watching = sensors, watching
        self._first_ns: int | None = None
        self._ticked_s = monotonic()
        self._silence: Notice | None = None

    def open(self) -> None:
        self.source.start()

    def close(self) -> None:
        self.source.close()

    def successor(self, detectors: Detectors) -> LivePipeline:
        """Continues from the newest tick with the same sensors, which stay open, and other detectors."""
        fresh = LivePipeline(self.source, detectors, self._sensors, self._watching)
        fresh.newest, fresh._first_ns = self.newest, self._first_ns
        fresh._silence = self._silence  # its notice is still shown
        return fresh

    def wait(self, params: Params, timeout_s: float) -> Frame | None:
        """The newest tick of the sensors; None if none arrived in time. The image of the next one is processed
        meanwhile."""
        with at_work("the sensors' next tick"):
            return self._detectors.next_tick(self.source, timeout_s, params)

    def run(self, frame: Frame, params: Params) -> ProcessedFrame:
        """Run the pipeline on what ``wait`` returned."""
        self._ticked_s = monotonic()
        self._first_ns = frame.t_ns if self._first_ns is None else self._first_ns
        before = self.newest.after if self.newest is not None else State()
        with at_work("the pipeline"):
            frame, detectors = self._detectors.of(frame)
            ran = advance(before, frame, params, used(detectors, params), self._sensors, self._detectors.look)
        spent_ms = self._ask.since_last_asked_ms()
        self.newest = ProcessedFrame(before, ran.frame, ran.state, ran.result, ran.lidar, params, spent_ms, exact=True)
        self._ticked_s = monotonic()  # on a busy machine, a tick may take longer than sensors may be silent
        return self.newest

    def with_silence(self, notices: tuple[Notice, ...]) -> tuple[Notice, ...]:
        """The notices, plus one that lists the missing sensors if no tick has arrived for a second."""
        others = tuple(notice for notice in notices if notice is not self._silence)
        if monotonic() - self._ticked_s < _SILENCE_S:
            self._silence = None
            return others
        missing = not_delivering(self.source.health()) or "no data yet"
        self._silence = Notice("warning", f"Waiting for sensors: {missing}")
        return (*others, self._silence)

    def time_s(self, processed: ProcessedFrame) -> float:
        """Seconds since the first tick."""
        return (processed.frame.t_ns - (self._first_ns or processed.frame.t_ns)) / 1e9


class _TimedLook:
    """Calls detectors directly, and measures their run time."""

    def __init__(self) -> None:
        self._spent_ms = 0.0

    def since_last_asked_ms(self) -> float:
        """Run time of all detectors since the last call of this method."""
        spent_ms, self._spent_ms = self._spent_ms, 0.0
        return spent_ms

    def __call__(self, detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen:
        start = perf_counter()
        with at_work(NETWORK + detector.name):
            found = detector.detect(bgr)
        self._spent_ms += (perf_counter() - start) * 1e3
        return found
