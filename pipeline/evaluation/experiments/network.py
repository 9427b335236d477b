"""The embedded network for experiments that drive with drawn pictures."""

from __future__ import annotations

from functools import cache

from pipeline.simulation.camera import HEIGHT, WIDTH
from pipeline.vision.detector import Detector, open_detector
from pipeline.vision.models import EMBEDDED


@cache
def embedded() -> Detector:
    """One a process; it is ready only after a while."""
    return open_detector(EMBEDDED, (WIDTH, HEIGHT))
