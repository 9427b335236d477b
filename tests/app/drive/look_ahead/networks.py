"""Detectors and recordings for the tests of this folder."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from app.core.detection_cache import DetectionCache
from app.core.playback_clock import timeline_s
from app.drive.open_recording import OpenRecording, RunSetup
from pipeline.detection import Detectors
from pipeline.inference.model_registry import EMBEDDED_FILE
from pipeline.vision.detector import Detector, open_detector
from pipeline.vision.far_view import FarView
from tests.app.engine.recording_helpers import Recording

FRAMES = 24
COMMAND = (
    sys.executable,
    "-c",
    "from app.drive.look_ahead import process; process.take_idle_priority = lambda: None; process.main()",
)
"""The process, but not at idle priority: tests wait for it, and other tests want the processor."""


def own_network(folder: Path) -> Detector:
    """The embedded network as a user's own file."""
    file = folder / "own.onnx"
    shutil.copyfile(EMBEDDED_FILE, file)
    return open_detector(str(file), (320, 180))


def both_views(folder: Path) -> Detectors:
    """That network on the whole image and on a far view."""
    boxes = own_network(folder)
    return Detectors(boxes, far=FarView(open_detector(str(boxes.path), None, boxes.threads, (96, 96)), 96))


def setup(detectors: Detectors, recording: Recording | None = None) -> RunSetup:
    """A drive with these detectors."""
    source = recording or Recording(count=FRAMES)
    times = timeline_s([source.t_ns(index) for index in range(len(source))], source.rate_hz)
    return RunSetup(source, times, detectors, "both")


def opened(detectors: Detectors) -> OpenRecording:
    """It, open, with an empty cache."""
    return OpenRecording(setup(detectors), DetectionCache(), 1)
