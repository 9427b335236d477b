"""source → detector → step: every frame of a recording, in order, with its result."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Literal

from pipeline.params import Params
from pipeline.sources.base import Source, is_simulated
from pipeline.step import State, step, warm_up
from pipeline.types import Frame, Result
from pipeline.vision.detector import Detector, open_detector
from pipeline.vision.models import EMBEDDED

Sensors = Literal["lidar", "camera", "both"]


def detector_for(source: Source, spec: str | None = None) -> Detector:
    """The named network, its input fitted to the source's pictures. Without a name: the embedded one for the
    simulator, which it was trained on and where a network for real pictures does worse; else the default one.

    DetectorMissing when there is none, DetectorError when it cannot be run.
    """
    if spec is None and is_simulated(source):
        spec = EMBEDDED
    return open_detector(spec, picture_size(source))


def picture_size(source: Source) -> tuple[int, int] | None:
    """(width, height) of the source's pictures, from its first frame; null without picture and calibration."""
    frame = source.frame(0)
    if frame.picture is not None:
        return frame.picture.bgr.shape[1], frame.picture.bgr.shape[0]
    return (frame.camera.width, frame.camera.height) if frame.camera is not None else None


def detect(frame: Frame, detector: Detector | None) -> Frame:
    """The frame with the network's boxes in it. The network runs here and nowhere else."""
    if detector is None or frame.picture is None:
        return frame
    return replace(frame, raw_boxes=detector.detect(frame.picture.bgr))


def only(frame: Frame, sensors: Sensors) -> Frame:
    """The frame as a car without the other sensor would have it. The picture stays: people still want to see it."""
    if sensors == "lidar":
        return replace(frame, raw_boxes=None)
    if sensors == "camera":
        return replace(frame, sweep=None)
    return frame


def run(
    source: Source, params: Params, detector: Detector | None, sensors: Sensors = "both"
) -> Iterator[tuple[Frame, Result]]:
    """Each frame with its result. ``detector`` null: LiDAR goes on alone."""
    warm_up()
    state = State()
    for index in range(len(source)):
        frame = source.frame(index)
        frame = only(detect(frame, detector if sensors != "lidar" else None), sensors)
        state, result = step(state, frame, params)
        yield frame, result
