"""A frame after the pipeline has processed it, with everything needed to run it again."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pipeline.params import Params
from pipeline.step import State, step
from pipeline.types import Frame, Result


@dataclass(frozen=True, eq=False)
class ProcessedFrame:
    """One frame, the pipeline's state before and after it, and its result."""

    before: State
    """The state that the frame was run from, so that it can be run again with other parameters."""
    frame: Frame
    """The input, detections included."""
    after: State
    """The state that the next frame is run from."""
    result: Result
    """What the frame came to."""
    params: Params
    """What it was run with."""
    detect_ms: float
    """How long networks took for it, in milliseconds."""
    exact: bool = False
    """``before`` is the state of a run over the whole drive from its first frame, so the result equals that of
    ``cipv run``; otherwise it comes from a short warm-up, and object numbers may differ."""
    whole: bool = True
    """The warm-up was complete and all detectors have run; otherwise the frame was wanted at once: trackers have hardly
    any history, and lanes may not have been detected."""

    def rerun(self, params: Params) -> ProcessedFrame:
        """The frame with other parameters, from the same state. Runs no network."""
        after, result = step(self.before, self.frame, params)
        return replace(self, after=after, result=result, params=params)
