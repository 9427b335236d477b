"""From a source's frame to the input of ``pipeline.step.step``: detected in, and restricted to the sensors in use.

``pipeline.run.advance`` does this and the step in one. This is for callers that keep the input: to step it with several
sets of parameters, or to have it ready before it is due.
"""

from __future__ import annotations

from pipeline.run import Detectors, Look, Sensors, detect, look, only
from pipeline.types import Frame


def frame_input(frame: Frame, detectors: Detectors, sensors: Sensors = "both", ask: Look = look) -> Frame:
    """The frame as ``step`` takes it. With ``sensors="lidar"`` no network runs.

    Args:
        frame: as its source gave it.
        detectors: find vehicles and lanes in its picture.
        sensors: those whose data the pipeline may use.
        ask: how a detector is asked: straight away, or through a cache.
    """
    return only(frame if sensors == "lidar" else detect(frame, detectors, ask), sensors)
