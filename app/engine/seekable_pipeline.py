"""The pipeline on one open recording: seeks, advances, and runs the shown frame again with other parameters.

It uses neither threads nor a clock. It returns ``ProcessedFrame``, which holds the state before its frame.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

from app.core.detection_cache import DetectionCache
from app.core.lru import BoundedCache
from app.core.playback_clock import timeline_s
from app.engine.processed_frame import ProcessedFrame
from pipeline.common.watchdog import at_work
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.run import Sensors, advance, sensed
from pipeline.step import State
from pipeline.types import Frame
from pipeline.types.source import Source

WARM_UP_FRAMES = 10
"""A seek runs this many frames before its target, so that trackers there have history and confirmations."""
AT_ONCE_FRAMES = 1
"""The same for immediate display if the previous frames have been neither read nor processed by detectors yet: 50 ms
each."""
_CACHED_FRAMES_BYTES = 192e6


def _nothing_known(index: int, params: Params) -> State | None:
    return None


class SeekablePipeline:
    """The pipeline, a source, the detectors for its images, and their caches. For one thread, except ``prepare``.

    ``state_before`` returns the state before a frame in a run over the whole drive, None if unknown.
    """

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
        self.shown: ProcessedFrame | None = None
        self._detectors = detectors
        self._state_before = state_before
        self._ask = detections.look_at(source.uri)
        self._ask_ahead = self._ask.clone()
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
    ) -> ProcessedFrame | None:
        """Jump to ``index``: exactly if the state there is known, otherwise from a fresh state ``WARM_UP_FRAMES``
        before it. In both cases the result depends only on the recording, the index and the parameters. None, with
        nothing changed, if ``superseded`` became true meanwhile.

        at_once: if the previous frames are not cached, the warm-up is cut to ``AT_ONCE_FRAMES``, the lane detector,
        which takes longest, does not run, and the others run only on the frame itself. The result is then not
        ``whole``.
        """
        known = self._known(index, params)
        first = whole_first = index if known is not None else max(0, index - WARM_UP_FRAMES)
        if at_once and not all(self._is_at_hand(i) for i in range(first, index)):
            first = max(0, index - AT_ONCE_FRAMES)
        frames = range(first, index + 1)
        asked = [self._asked_at_once(i, is_wanted=i == index) if at_once else self._detectors for i in frames]
        is_whole = first == whole_first and all(each is self._detectors for each in asked)
        is_exact = is_whole and (known is not None or first == 0)
        state, processed = known or State(), None
        for i, detectors in zip(frames, asked, strict=True):
            if superseded():
                return None
            processed = self._run(state, i, params, detectors, exact=is_exact)
            state = processed.after
        assert processed is not None
        self.shown = replace(processed, whole=is_whole)
        return self.shown

    def advance(self, index: int, params: Params) -> ProcessedFrame:
        """Run ``index`` after the shown frame. If the state there is unknown, trackers miss the frames skipped in
        between; every filter uses the real time step."""
        shown, known = self.shown, self._known(index, params)
        if known is not None:
            self.shown = self._run(known, index, params, self._detectors, exact=True)
        elif shown is None:
            self.shown = self._run(State(), index, params, self._detectors, exact=False)
        else:
            is_next = index == shown.frame.index + 1 and params == shown.params
            self.shown = self._run(shown.after, index, params, self._detectors, exact=shown.exact and is_next)
        return self.shown

    def rerun(self, params: Params) -> ProcessedFrame | None:
        """The shown frame with other parameters: from their state in the whole-drive run if known, otherwise from the
        state it started with. Runs no network and reads nothing, so a frame that is not ``whole`` stays that way."""
        if self.shown is None:
            return None
        known = self._known(self.shown.frame.index, params) if self.shown.whole else None
        self.shown = replace(self.shown.rerun(params, known), exact=known is not None)
        return self.shown

    def prepare(self, index: int) -> None:
        """Read a frame and run the detectors on it, so that a later run does not wait for either. For a second
        thread."""
        spent_ms = self._ask_ahead.spent_ms
        sensed(self._read(index), self._detectors, self._sensors, self._ask_ahead)
        self._ahead_ms = (index, self._ask_ahead.spent_ms - spent_ms)

    def can_be_exact(self) -> bool:
        """Whether the shown frame differs from the whole-drive run and a rerun would make it equal."""
        shown = self.shown
        if shown is None or shown.exact or not shown.whole:
            return False
        return self._known(shown.frame.index, shown.params) is not None

    def knows(self, index: int, params: Params) -> bool:
        """Whether the frame can be shown exactly as in the whole-drive run."""
        return self._known(index, params) is not None

    def _known(self, index: int, params: Params) -> State | None:
        return State() if index == 0 else self._state_before(index, params)

    def _run(self, state: State, index: int, params: Params, detectors: Detectors, *, exact: bool) -> ProcessedFrame:
        spent_ms = self._ask.spent_ms
        frame = self._read(index)
        with at_work("the pipeline"):
            ran = advance(state, frame, params, detectors, self._sensors, self._ask)
        ahead, ahead_ms = self._ahead_ms
        detect_ms = self._ask.spent_ms - spent_ms + (ahead_ms if ahead == index else 0.0)
        return ProcessedFrame(state, ran.frame, ran.state, ran.result, ran.lidar, params, detect_ms, exact)

    def _asked_at_once(self, index: int, *, is_wanted: bool = False) -> Detectors:
        """The detectors to run on a frame for immediate display, or in its warm-up: those whose outputs are cached."""
        asked = self._detectors
        if asked.boxes is not None and not is_wanted and not self._ask.knows(asked.boxes, index):
            asked = replace(asked, boxes=None)
        if asked.far is not None and asked.looks_far(index) and not is_wanted and not self._ask.knows(asked.far, index):
            asked = replace(asked, far=None)
        lanes = asked.lanes_of(index)
        if lanes is not None and not self._ask.knows(lanes, index):
            asked = replace(asked, lanes=None, far_lanes=None)
        return asked

    def _is_at_hand(self, index: int) -> bool:
        """Whether a frame has been read and processed by the detectors."""
        with self._reading:
            is_read = self._frames.get(index) is not None
        return is_read and self._asked_at_once(index) is self._detectors

    def _read(self, index: int) -> Frame:
        with at_work("reading a frame"), self._reading:
            held = self._frames.get(index)
            if held is None:
                held = self.source.frame(index)
                self._frames.put(index, held)
            return held


def _frame_bytes(frame: Frame) -> float:
    image = frame.image
    return (frame.sweep.points.nbytes if frame.sweep else 0) + (image.bgr.nbytes if image else 0) + 1000.0
