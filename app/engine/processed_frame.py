"""A frame after the pipeline has processed it, with everything needed to run it again."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pipeline import lidar_branch
from pipeline.lidar_branch import LidarBranch
from pipeline.params import Params
from pipeline.step import State, step
from pipeline.types import Frame, Result


@dataclass(frozen=True, eq=False)
class ProcessedFrame:
    """One frame, the pipeline's state before and after it, and its result."""

    before: State
    """The state before the frame, so that it can be run again with other parameters."""
    frame: Frame
    """The input, detections included."""
    after: State
    """The state for the next frame."""
    result: Result
    """The result for this frame."""
    lidar: LidarBranch
    """What was computed without the detections."""
    params: Params
    """The parameters used."""
    detect_ms: float
    """Run time of the networks for this frame, in milliseconds."""
    exact: bool = False
    """Whether ``before`` is the state of a run over the whole drive from its first frame, so that the result equals
    that of ``cipv run``; otherwise it comes from a short warm-up, and object ids may differ."""
    whole: bool = True
    """Whether the warm-up was complete and all detectors have run; otherwise the frame was made for immediate display:
    trackers have hardly any history, and lanes may not have been detected."""

    def rerun(self, params: Params, before: State | None = None) -> ProcessedFrame:
        """The frame with other parameters, from the same state or, if given, from another one. Runs no network, and of
        the LiDAR branch, after the same state, only what the changed parameters affect."""
        is_same = before is None or before is self.before
        start = self.before if before is None else before
        lidar = lidar_branch.follow(start, self.frame, params, self.lidar if is_same else None)
        after, result = step(start, self.frame, params, lidar)
        return replace(self, before=start, after=after, result=result, lidar=lidar, params=params)
