"""One open recording on the line: seek, advance, and run the shown frame again with other parameters.

No thread and no clock in here. Every answer is a ``Tick``, which holds the state before its frame, so that a frame can
be run again: ``step(tick.before, tick.frame, other_params)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import cast

from app.lru import BoundedCache
from app.playback import timeline_s
from pipeline.params import Params
from pipeline.run import Detectors, Detects, Look, Seen, Sensors, advance
from pipeline.sources.base import Source
from pipeline.step import State, step
from pipeline.types import U8, Frame, RawBoxes, RawLanes, Result

WARM_UP_FRAMES = 10
"""A seek runs this many frames before its target, so that trackers there have their history and confirmations."""
_CACHED_FRAMES_BYTES = 192e6
_CACHED_ANSWERS = 8192


@dataclass(frozen=True, eq=False)
class Tick:
    """One frame, what the line believed before it and after it, and what it believes at it."""

    before: State
    frame: Frame
    after: State
    result: Result
    params: Params
    detect_ms: float


class DetectionCache:
    """What detectors answered, by (source, frame, detector), bounded; it outlives the source, so reopening costs no
    network. spent_ms: how long the detectors have run in all."""

    def __init__(self, limit: int = _CACHED_ANSWERS) -> None:
        self.spent_ms = 0.0
        self._answers: BoundedCache[tuple[str, int, str], RawBoxes | RawLanes] = BoundedCache(limit, lambda _: 1)

    def asker(self, uri: str) -> Look:
        """How to ask about the pictures of one source."""

        def ask(detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen:
            key = (uri, frame.index, detector.name)
            held = self._answers.get(key)
            if held is not None:
                return cast("Seen", held)
            start = perf_counter()
            found = detector.detect(bgr)
            self.spent_ms += (perf_counter() - start) * 1e3
            self._answers.put(key, found)
            return found

        return ask


class Line:
    """A source, the detectors for its pictures, and their caches. Used by one thread."""

    def __init__(self, source: Source, detectors: Detectors, detections: DetectionCache, sensors: Sensors) -> None:
        self.source = source
        self.timeline_s = timeline_s([source.t_ns(i) for i in range(len(source))], source.rate_hz)
        self.tick: Tick | None = None
        self._detectors = detectors
        self._detections = detections
        self._ask = detections.asker(source.uri)
        self._sensors = sensors
        self._frames: BoundedCache[int, Frame] = BoundedCache(_CACHED_FRAMES_BYTES, _frame_bytes)

    def seek(self, index: int, params: Params, superseded: Callable[[], bool] = lambda: False) -> Tick | None:
        """Jump to ``index``, from a fresh state ``WARM_UP_FRAMES`` before it. The answer depends on nothing but the
        recording, the index and the parameters. Null, and nothing changed, when ``superseded`` said so on the way."""
        state, tick = State(), None
        for i in range(max(0, index - WARM_UP_FRAMES), index + 1):
            if superseded():
                return None
            tick = self._run(state, i, params)
            state = tick.after
        self.tick = tick
        return tick

    def advance(self, index: int, params: Params) -> Tick:
        """Run ``index`` after the shown frame. Frames skipped between are simply not seen; time is real."""
        state = self.tick.after if self.tick is not None else State()
        self.tick = self._run(state, index, params)
        return self.tick

    def rerun(self, params: Params) -> Tick | None:
        """The shown frame with other parameters, from the state it started with. No network, no reading."""
        if self.tick is None:
            return None
        after, result = step(self.tick.before, self.tick.frame, params)
        self.tick = replace(self.tick, after=after, result=result, params=params)
        return self.tick

    def _run(self, state: State, index: int, params: Params) -> Tick:
        spent_ms = self._detections.spent_ms
        frame, after, result = advance(state, self._read(index), params, self._detectors, self._sensors, self._ask)
        return Tick(state, frame, after, result, params, self._detections.spent_ms - spent_ms)

    def _read(self, index: int) -> Frame:
        held = self._frames.get(index)
        if held is None:
            held = self.source.frame(index)
            self._frames.put(index, held)
        return held


def _frame_bytes(frame: Frame) -> float:
    picture = frame.picture
    return (frame.sweep.points.nbytes if frame.sweep else 0) + (picture.bgr.nbytes if picture else 0) + 1000.0
