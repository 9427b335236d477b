"""The inputs of the pipeline in an experiment: which sensors, and where the camera's boxes come from."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Literal

from pipeline.inference.model_registry import EMBEDDED
from pipeline.run import Sensors
from pipeline.simulation.closed_loop import Eyes, NetworkEyes, TruthEyes
from pipeline.simulation.sensors.camera import HEIGHT, WIDTH
from pipeline.simulation.sensors.detection_model import BoxNoise, Detections
from pipeline.vision.detector import Detector, open_detector
from pipeline.vision.far_view import FarView, open_far_view

Boxes = Literal["truth", "network"]
"""Source of the camera's boxes: projected truth with a detector's errors, or the embedded network on rendered
images."""
SENSORS: Mapping[Sensors, str] = {"lidar": "LiDAR", "camera": "camera", "both": "fused"}
"""Names of the sensors in reports."""
COMPARED: tuple[Sensors, ...] = ("lidar", "both")
"""The sensors that most experiments compare: the LiDAR alone, and both."""
GIVEN = Detections(boxes=BoxNoise())
GIVEN_SAID = (
    "The camera's boxes are given: projected ground truth with assumed errors close to those measured for the embedded "
    "detector. No network was used."
)


@cache
def embedded() -> Detector:
    """The embedded network for rendered images; one per process, since loading takes a while."""
    return open_detector(EMBEDDED, (WIDTH, HEIGHT))


@cache
def embedded_far_view() -> FarView | None:
    """Its second run on the far part of the same images."""
    return open_far_view(embedded(), (WIDTH, HEIGHT))


def eyes_for(boxes: Boxes) -> Eyes:
    return TruthEyes() if boxes == "truth" else NetworkEyes(embedded(), embedded_far_view())


def detections_for(boxes: Boxes) -> Detections | None:
    """The detections with which a drive is replayed; None for those of the embedded network."""
    return GIVEN if boxes == "truth" else None


def boxes_said(boxes: Boxes) -> str:
    """The suffix of a drive's title."""
    return "" if boxes == "truth" else ", network"
