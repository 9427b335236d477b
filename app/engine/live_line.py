"""Live sensors on the line: the newest tick through detectors and step, each once, none twice.

There is no way back. What nobody took in time is dropped, so that what is shown is never older than sensors and line
make it. Used by one thread.
"""

from __future__ import annotations

from dataclasses import replace
from time import monotonic, perf_counter

from app.core.line import Tick
from app.engine.snapshot import Notice
from pipeline.detection import Detectors, Detects, LiveDetectors, Seen
from pipeline.params import Params
from pipeline.run import Sensors, advance
from pipeline.sources.live.health import not_delivering
from pipeline.step import State, step
from pipeline.types import U8, Frame
from pipeline.types.source import LiveSource

_SILENCE_S = 1.0


class LiveLine:
    """``open`` sensors, ``wait`` for a frame and ``run`` it again and again, ``close``. tick: the newest."""

    def __init__(self, source: LiveSource, detectors: Detectors, sensors: Sensors) -> None:
        self.source = source
        self.tick: Tick | None = None
        self._detectors, self._sensors = LiveDetectors(detectors), sensors
        self._first_ns: int | None = None
        self._ticked_s = monotonic()
        self._silence: Notice | None = None

    def open(self) -> None:
        self.source.start()

    def close(self) -> None:
        self.source.close()

    def wait(self, params: Params, timeout_s: float) -> Frame | None:
        """The newest tick of the sensors; null when none came in time."""
        return self.source.next(timeout_s, params.sync)

    def run(self, frame: Frame, params: Params) -> Tick:
        """What ``wait`` gave, through the line."""
        self._ticked_s = monotonic()
        self._first_ns = frame.t_ns if self._first_ns is None else self._first_ns
        before = self.tick.after if self.tick is not None else State()
        ask = _TimedLook()
        frame, after, result = advance(before, frame, params, self._detectors.of(frame), self._sensors, ask)
        self.tick = Tick(before, frame, after, result, params, ask.spent_ms, exact=True)
        return self.tick

    def with_silence(self, notices: tuple[Notice, ...]) -> tuple[Notice, ...]:
        """The notices with whom it waits for, while nothing has ticked for a second."""
        others = tuple(notice for notice in notices if notice is not self._silence)
        if monotonic() - self._ticked_s < _SILENCE_S:
            self._silence = None
            return others
        missing = not_delivering(self.source.health()) or "none ticks"
        self._silence = Notice("warning", f"Waiting for sensors: {missing}")
        return (*others, self._silence)

    def time_s(self, tick: Tick) -> float:
        """Seconds since the first tick."""
        return (tick.frame.t_ns - (self._first_ns or tick.frame.t_ns)) / 1e9


def rerun(shown: Tick, params: Params) -> Tick:
    """A held tick with other parameters, from the state it started with. No network; the line's own state stays."""
    after, result = step(shown.before, shown.frame, params)
    return replace(shown, after=after, result=result, params=params)


class _TimedLook:
    """Asks detectors straight away. spent_ms: how long they took."""

    def __init__(self) -> None:
        self.spent_ms = 0.0

    def __call__(self, detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen:
        start = perf_counter()
        found = detector.detect(bgr)
        self.spent_ms += (perf_counter() - start) * 1e3
        return found
