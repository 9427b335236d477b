"""One open recording on the line: seek, advance, and run the shown frame again with other parameters.

No thread and no clock in here. Every answer is a ``Tick``, which holds the state before its frame, so that a frame can
be run again: ``step(tick.before, tick.frame, other_params)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Protocol

from app.lru import BoundedCache
from app.playback import timeline_s
from pipeline.params import Params
from pipeline.run import Sensors, only
from pipeline.sources.base import Source
from pipeline.step import State, step
from pipeline.types import U8, Frame, RawBoxes, Result

WARM_UP_FRAMES = 10
"""A seek runs this many frames before its target, so that trackers there have their history and confirmations."""
_CACHED_FRAMES_BYTES = 192e6
_CACHED_BOXES = 4096


class Detects(Protocol):
    """What the line needs of a detector. notes: what a person should know about it."""

    @property
    def name(self) -> str: ...

    @property
    def notes(self) -> tuple[str, ...]: ...

    def detect(self, bgr: U8) -> RawBoxes: ...


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
    """Raw boxes by (source, frame, detector), bounded; it outlives the source, so reopening costs no network."""

    def __init__(self, limit: int = _CACHED_BOXES) -> None:
        self._boxes: BoundedCache[tuple[str, int, str], RawBoxes] = BoundedCache(limit, lambda _: 1)

    def boxes(self, uri: str, frame: Frame, detector: Detects) -> tuple[RawBoxes | None, float]:
        """The boxes and the milliseconds that the network took for them; null when there is no picture."""
        if frame.picture is None:
            return None, 0.0
        key = (uri, frame.index, detector.name)
        held = self._boxes.get(key)
        if held is not None:
            return held, 0.0
        start = perf_counter()
        found = detector.detect(frame.picture.bgr)
        self._boxes.put(key, found)
        return found, (perf_counter() - start) * 1e3


class Line:
    """A source, the detector for its pictures, and their caches. Used by one thread."""

    def __init__(self, source: Source, detector: Detects | None, detections: DetectionCache, sensors: Sensors) -> None:
        self.source = source
        self.timeline_s = timeline_s([source.t_ns(i) for i in range(len(source))], source.rate_hz)
        self.tick: Tick | None = None
        self._detector = detector if sensors != "lidar" else None
        self._detections = detections
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
        frame = self._read(index)
        boxes, detect_ms = None, 0.0
        if self._detector is not None:
            boxes, detect_ms = self._detections.boxes(self.source.uri, frame, self._detector)
        frame = only(replace(frame, raw_boxes=boxes), self._sensors)
        after, result = step(state, frame, params)
        return Tick(state, frame, after, result, params, detect_ms)

    def _read(self, index: int) -> Frame:
        held = self._frames.get(index)
        if held is None:
            held = self.source.frame(index)
            self._frames.put(index, held)
        return held


def _frame_bytes(frame: Frame) -> float:
    picture = frame.picture
    return (frame.sweep.points.nbytes if frame.sweep else 0) + (picture.bgr.nbytes if picture else 0) + 1000.0
