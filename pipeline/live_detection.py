"""When detectors run on live sensors, and which. A tick must leave before the next one arrives, and only the newest is
processed, so what a slow machine has no time for is left out, and the result says so. A fast machine is idle until the
next sweep is complete, and processes the image that belongs to it in the meantime."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import cast

from pipeline.common.watchdog import NETWORK, at_work
from pipeline.detection import Detectors, Detects, Look, Seen, look
from pipeline.params import Params
from pipeline.types import U8, Frame, RawBoxes, RawLanes
from pipeline.types.source import LiveSource

FAR_LEFT_OUT = "the far view was left out, because sensor data was dropped: this machine is too slow for all networks"
LANES_LEFT_OUT = (
    "lane detection was left out, because it is still processing an earlier image: this machine is too slow"
)
CALM_TICKS = 50
"""Number of ticks without a dropped one after which the far view runs in every tick again: 5 s at 10 Hz."""
_LOOK_AGAIN_S = 0.005
"""How often it is checked whether the image of the next tick is known."""


class LiveDetectors:
    """Selects the detectors for each processed tick of live sensors. Lane lines are detected again after
    ``lanes_every`` processed ticks; the frame index cannot be used, because it also counts dropped ticks. If ticks are
    dropped, the machine is too slow for everything, and the far view runs only in every other tick.

    A lane detector that is too slow for every tick is too slow for a single one, too. It runs on a thread of its own
    while ticks go on, and its lines come with the first tick after that, with their age.

    Args:
        detectors: those of the source.
        watching: a context around the work of that thread.
        ask: how all other detectors are called.
    """

    def __init__(
        self,
        detectors: Detectors,
        watching: Callable[[], AbstractContextManager[None]] = nullcontext,
        ask: Look = look,
    ) -> None:
        self._detectors, self._watching, self._ask = detectors, watching, ask
        self._early: tuple[U8, dict[str, RawBoxes | RawLanes]] | None = None
        """The image processed before its tick, and what detectors found in it, by their names."""
        self._since_lanes = detectors.lanes_every
        self._lanes_turn = -1
        """Number of turns that lane detectors had, minus one."""
        self._last_index: int | None = None
        self._calm = CALM_TICKS
        self._looked_far = False
        self._beside: tuple[int, Future[RawLanes]] | None = None
        """The time of the image that the lane detector processes on its own thread, and its lines."""

    def of(self, frame: Frame) -> tuple[Frame, Detectors]:
        """A tick, with the lane lines of an earlier one if they were found since the last tick, and the detectors for
        its image. Call this once per tick. A tick without an image passes its turn to the next. Raises what the lane
        detector raised."""
        frame = self._with_lines(frame)
        left_out: list[str] = []
        lanes = self._detectors.lanes_in_turn(self._lanes_turn) if self._is_lanes_turn(frame) else None
        if lanes is not None and self._detectors.lanes_every > 1:
            if not self._starts(lanes, frame):
                left_out.append(LANES_LEFT_OUT)
            lanes = None
        far = self._detectors.far if self._has_time_to_look_far(frame) else None
        if far is not self._detectors.far and frame.image is not None:
            left_out.append(FAR_LEFT_OUT)
        asked = Detectors(self._detectors.boxes, lanes, far=far, left_out=tuple(left_out))
        return frame, asked

    def next_tick(self, source: LiveSource, timeout_s: float, params: Params) -> Frame | None:
        """The newest tick of the source; None if none arrives in time. Until then, the detectors process the image
        that it will have."""
        end_s = time.monotonic() + timeout_s
        while True:
            left_s = end_s - time.monotonic()
            frame = source.next(max(0.0, min(left_s, _LOOK_AGAIN_S)), params.sync)
            if frame is not None or left_s <= 0.0:
                return frame
            upcoming = source.upcoming(params.sync)
            if upcoming is not None:
                self._process_early(upcoming, params.detection.far_view)

    def look(self, detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen:
        """What the detector found in this image before its tick, or finds in it now."""
        if self._early is not None and self._early[0] is bgr and detector.name in self._early[1]:
            return cast("Seen", self._early[1][detector.name])
        return self._ask(detector, frame, bgr)

    def _process_early(self, frame: Frame, far_view: bool) -> None:
        """Run those detectors that ``of`` will ask for on the image of a tick."""
        if frame.image is None or (self._early is not None and self._early[0] is frame.image.bgr):
            return
        bgr = frame.image.bgr
        found: dict[str, RawBoxes | RawLanes] = {}
        self._early = bgr, found
        boxes, far = self._detectors.boxes, self._detectors.far
        lanes = self._detectors.lanes_in_turn(self._lanes_turn + 1)
        if boxes is not None:
            found[boxes.name] = self._ask(boxes, frame, bgr)
        if far is not None and far_view and self._calm >= CALM_TICKS:
            found[far.name] = self._ask(far.of(frame), frame, bgr)
        if lanes is not None and self._detectors.lanes_every == 1:
            found[lanes.name] = self._ask(lanes, frame, bgr)

    def _is_lanes_turn(self, frame: Frame) -> bool:
        is_due = self._since_lanes >= self._detectors.lanes_every and frame.image is not None
        self._since_lanes = 1 if is_due else self._since_lanes + 1
        self._lanes_turn += is_due
        return is_due

    def _with_lines(self, frame: Frame) -> Frame:
        if self._beside is None or not self._beside[1].done():
            return frame
        (seen_ns, found), self._beside = self._beside, None
        lines, age_s = found.result(), (frame.t_ns - seen_ns) / 1e9
        # nobody knows how old they are after a clock was set back
        return replace(frame, raw_lanes=replace(lines, age_s=age_s)) if age_s > 0.0 else frame

    def _starts(self, lanes: Detects[RawLanes], frame: Frame) -> bool:
        """Process the image of a tick on a thread; false while an earlier one is processed."""
        if self._beside is not None or frame.image is None:
            return False
        found: Future[RawLanes] = Future()
        self._beside = frame.t_ns, found
        work = (lanes, frame.image.bgr, found)
        threading.Thread(target=self._detect, args=work, name="cipv-lanes", daemon=True).start()
        return True

    def _detect(self, lanes: Detects[RawLanes], bgr: U8, found: Future[RawLanes]) -> None:
        with self._watching(), at_work(NETWORK + lanes.name):
            try:
                found.set_result(lanes.detect(bgr))
            except Exception as error:  # raised in the next tick, as if the detector had run there
                found.set_exception(error)

    def _has_time_to_look_far(self, frame: Frame) -> bool:
        dropped = self._last_index is not None and frame.index > self._last_index + 1
        self._calm = 0 if dropped else self._calm + 1
        self._last_index = frame.index
        self._looked_far = self._calm >= CALM_TICKS or not self._looked_far
        return self._looked_far
