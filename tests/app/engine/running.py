"""Helpers for tests with a running engine."""

from __future__ import annotations

import json
from collections.abc import Callable

from app.engine.engine import Engine
from app.engine.snapshot import Snapshot
from pipeline.params import Params
from pipeline.step import State, step
from pipeline.types import Result
from pipeline.types.result_json import to_json
from tests.app.engine.recording_helpers import CountingDetector, Recording

WAIT_S = 180.0


Start = Callable[..., tuple[Engine, Recording, CountingDetector]]


def body(result: Result) -> str:
    """A result as JSON, without timings."""
    plain = to_json(result)
    del plain["timing_ms"]
    return json.dumps(plain)


def at(index: int) -> Callable[[Snapshot], bool]:
    """A condition: the frame is shown, with the state after a complete warm-up."""
    return lambda s: s.processed is not None and s.index == index and s.processed.whole


def played(recording: Recording, first: int, last: int, params: Params, looked_from: int = 0) -> Result:
    """The pipeline's result at ``last``, run from a fresh state at ``first``. Images before ``looked_from`` have no
    detections."""
    detector, state = CountingDetector(), State()
    for index in range(first, last + 1):
        frame = recording.frame(index)
        assert frame.image is not None
        boxes = detector.detect(frame.image.bgr) if index >= looked_from else None
        state, result = step(state, type(frame)(**{**vars(frame), "raw_boxes": boxes}), params)
    return result
