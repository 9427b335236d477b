"""One open recording on the line: seek, advance, and run the shown frame again with other parameters.

No thread and no clock in here. Every answer is a ``Tick``, which holds the state before its frame, so that a frame can
be run again: ``step(tick.before, tick.frame, other_params)``.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import cast

from app.core.lru import BoundedCache
from app.core.playback_clock import timeline_s
from pipeline.detection import Detectors, Detects, Seen, detect
from pipeline.params import Params
from pipeline.run import Sensors, advance
from pipeline.sources.fingerprint import fingerprint
from pipeline.step import State, step
from pipeline.types import U8, Frame, RawBoxes, RawLanes, Result
from pipeline.types.source import Source

WARM_UP_FRAMES = 10
"""A seek runs this many frames before its target, so that trackers there have their history and confirmations."""
AT_ONCE_FRAMES = 1
"""The same, where somebody waits and the frames before have not been read and looked at yet: that takes 50 ms each."""
_CACHED_FRAMES_BYTES = 192e6
_CACHED_ANSWERS = 8192


@dataclass(frozen=True, eq=False)
class Tick:
    """One frame, what the line believed before it and after it, and what it believes at it.

    exact: ``before`` is the state of a run through the whole drive from its first frame, so that the result is the one
    that ``cipv run`` gives; else it comes from a short warm-up, and numbers of objects may differ. whole: the warm-up
    was a whole one, and all detectors have looked; else the frame was wanted at once: trackers have hardly any history,
    and nobody may have looked for lanes."""

    before: State
    frame: Frame
    after: State
    result: Result
    params: Params
    detect_ms: float
    exact: bool = False
    whole: bool = True


class DetectionCache:
    """What detectors answered, by (source, frame, detector), bounded; it outlives the source, so reopening costs no
    network, unless the source's files have changed. Any thread."""

    def __init__(self, limit: int = _CACHED_ANSWERS) -> None:
        self._lock = threading.Lock()
        self._answers: BoundedCache[tuple[str, int, str], RawBoxes | RawLanes] = BoundedCache(limit, lambda _: 1)

    def asker(self, uri: str) -> Asker:
        """How to ask about the pictures of one source, as its files are now."""
        return Asker(self, fingerprint(uri))

    def get(self, key: tuple[str, int, str]) -> RawBoxes | RawLanes | None:
        with self._lock:
            return self._answers.get(key)

    def put(self, key: tuple[str, int, str], answer: RawBoxes | RawLanes) -> None:
        with self._lock:
            self._answers.put(key, answer)


class Asker:
    """Asks the cache first. Used by one thread; spent_ms: how long detectors have run for it in all."""

    def __init__(self, cache: DetectionCache, source: str) -> None:
        self.spent_ms = 0.0
        self._cache, self._source = cache, source

    def another(self) -> Asker:
        """The same for a second thread."""
        return Asker(self._cache, self._source)

    def knows(self, detector: Detects[Seen], index: int) -> bool:
        """Whether the answer about a frame is in the cache."""
        return self._cache.get((self._source, index, detector.name)) is not None

    def __call__(self, detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen:
        key = (self._source, frame.index, detector.name)
        held = self._cache.get(key)
        if held is not None:
            return cast("Seen", held)
        start = perf_counter()
        found = detector.detect(bgr)
        self.spent_ms += (perf_counter() - start) * 1e3
        self._cache.put(key, found)
        return found


def _nothing_known(index: int, params: Params) -> State | None:
    return None


class Line:
    """A source, the detectors for its pictures, and their caches. Used by one thread, but for ``prepare``.

    state_before: the state in which a run through the whole drive with these parameters comes to a frame, null where
    nobody knows it."""

    def __init__(
        self,
        source: Source,
        detectors: Detectors,
        detections: DetectionCache,
        sensors: Sensors,
        state_before: Callable[[int, Params], State | None] = _nothing_known,
    ) -> None:
        self.source = source
        self.timeline_s = timeline_s([source.t_ns(i) for i in range(len(source))], source.rate_hz)
        self.tick: Tick | None = None
        self._detectors = detectors
        self._state_before = state_before
        self._ask = detections.asker(source.uri)
        self._ask_ahead = self._ask.another()
        self._ahead_ms: tuple[int, float] = (-1, 0.0)
        self._reading = threading.Lock()
        self._sensors = sensors
        self._frames: BoundedCache[int, Frame] = BoundedCache(_CACHED_FRAMES_BYTES, _frame_bytes)

    def seek(
        self,
        index: int,
        params: Params,
        superseded: Callable[[], bool] = lambda: False,
        *,
        at_once: bool = False,
    ) -> Tick | None:
        """Jump to ``index``: exactly where the state there is known, else from a fresh state ``WARM_UP_FRAMES`` before
        it. Either way the answer depends on nothing but the recording, the index and the parameters. Null, and nothing
        changed, when ``superseded`` said so on the way.

        at_once: where the frames before are not at hand, the warm-up is cut to ``AT_ONCE_FRAMES``; and where they would
        have to be asked, detectors of lanes, which take longer than all else, are not, and others about the frame
        itself alone. The tick says so."""
        known = self._known(index, params)
        first = whole_first = index if known is not None else max(0, index - WARM_UP_FRAMES)
        if at_once and not all(self._is_at_hand(i) for i in range(first, index)):
            first = max(0, index - AT_ONCE_FRAMES)
        frames = range(first, index + 1)
        asked = [self._asked_at_once(i, is_wanted=i == index) if at_once else self._detectors for i in frames]
        is_whole = first == whole_first and all(each is self._detectors for each in asked)
        is_exact = is_whole and (known is not None or first == 0)
        state, tick = known or State(), None
        for i, detectors in zip(frames, asked, strict=True):
            if superseded():
                return None
            tick = self._run(state, i, params, detectors, exact=is_exact)
            state = tick.after
        assert tick is not None
        self.tick = replace(tick, whole=is_whole)
        return self.tick

    def advance(self, index: int, params: Params) -> Tick:
        """Run ``index`` after the shown frame. Where the state there is not known, frames skipped between are simply
        not seen; time is real."""
        shown, known = self.tick, self._known(index, params)
        if known is not None:
            self.tick = self._run(known, index, params, self._detectors, exact=True)
        elif shown is None:
            self.tick = self._run(State(), index, params, self._detectors, exact=False)
        else:
            is_next = index == shown.frame.index + 1 and params == shown.params
            self.tick = self._run(shown.after, index, params, self._detectors, exact=shown.exact and is_next)
        return self.tick

    def rerun(self, params: Params) -> Tick | None:
        """The shown frame with other parameters, from the state that they lead to where it is known, else from the one
        it started with. No network, no reading: what is not whole stays so."""
        if self.tick is None:
            return None
        known = self._known(self.tick.frame.index, params) if self.tick.whole else None
        before, exact = (self.tick.before, False) if known is None else (known, True)
        after, result = step(before, self.tick.frame, params)
        self.tick = replace(self.tick, before=before, after=after, result=result, params=params, exact=exact)
        return self.tick

    def prepare(self, index: int) -> None:
        """Read a frame and have the detectors look at it, so that running it later waits for neither. For a second
        thread."""
        spent_ms = self._ask_ahead.spent_ms
        if self._sensors != "lidar":
            detect(self._read(index), self._detectors, self._ask_ahead)
        else:
            self._read(index)
        self._ahead_ms = (index, self._ask_ahead.spent_ms - spent_ms)

    def can_be_exact(self) -> bool:
        """Whether the shown frame is not what a run through the whole drive gives, and run again could be."""
        shown = self.tick
        if shown is None or shown.exact or not shown.whole:
            return False
        return self._known(shown.frame.index, shown.params) is not None

    def _known(self, index: int, params: Params) -> State | None:
        return State() if index == 0 else self._state_before(index, params)

    def _run(self, state: State, index: int, params: Params, detectors: Detectors, *, exact: bool) -> Tick:
        spent_ms = self._ask.spent_ms
        frame, after, result = advance(state, self._read(index), params, detectors, self._sensors, self._ask)
        ahead, ahead_ms = self._ahead_ms
        detect_ms = self._ask.spent_ms - spent_ms + (ahead_ms if ahead == index else 0.0)
        return Tick(state, frame, after, result, params, detect_ms, exact)

    def _asked_at_once(self, index: int, *, is_wanted: bool = False) -> Detectors:
        """Whom to ask about a frame that is wanted at once, or on the way there; all when that takes no time."""
        asked = self._detectors
        if asked.boxes is not None and not is_wanted and not self._ask.knows(asked.boxes, index):
            asked = replace(asked, boxes=None)
        if asked.lanes is not None and asked.looks_for_lanes(index) and not self._ask.knows(asked.lanes, index):
            asked = replace(asked, lanes=None)
        return asked

    def _is_at_hand(self, index: int) -> bool:
        """Whether a frame was read and looked at."""
        with self._reading:
            is_read = self._frames.get(index) is not None
        return is_read and self._asked_at_once(index) is self._detectors

    def _read(self, index: int) -> Frame:
        with self._reading:
            held = self._frames.get(index)
            if held is None:
                held = self.source.frame(index)
                self._frames.put(index, held)
            return held


def _frame_bytes(frame: Frame) -> float:
    picture = frame.picture
    return (frame.sweep.points.nbytes if frame.sweep else 0) + (picture.bgr.nbytes if picture else 0) + 1000.0
