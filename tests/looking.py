"""Detectors that process each image once, and recordings that are read once, since tests run the same recordings again
and again."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Generic

from pipeline.detection import Detects, Seen_co, camera_of, far_lanes_for, lanes_for
from pipeline.sources import open_source
from pipeline.types import U8, Frame, RawBoxes, RawLanes
from pipeline.types.source import Source
from pipeline.vision.detector import open_detector
from pipeline.vision.far_view import FarView, open_far_view


class LooksOnce(Generic[Seen_co]):
    """Wraps a detector and caches its output for each image."""

    def __init__(self, detector: Detects[Seen_co]) -> None:
        self.detector = detector
        self._answers: dict[tuple[tuple[int, ...], int], Seen_co] = {}

    @property
    def name(self) -> str:
        return self.detector.name

    @property
    def notes(self) -> tuple[str, ...]:
        return self.detector.notes

    def detect(self, bgr: U8) -> Seen_co:
        key = (bgr.shape, hash(bgr.tobytes()))
        if key not in self._answers:
            self._answers[key] = self.detector.detect(bgr)
        return self._answers[key]


class ReadsOnce:
    """Wraps a recording and keeps its frames: those of the simulator take longer to draw than to process. For short
    recordings, since an image takes 2.8 MB."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._frames: dict[int, Frame] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._source, name)

    def __len__(self) -> int:
        return len(self._source)

    def frame(self, index: int) -> Frame:
        if index not in self._frames:
            self._frames[index] = self._source.frame(index)
        return self._frames[index]


@cache
def yolox_nano(data_dir: Path, width: int, height: int) -> LooksOnce[RawBoxes]:
    """The network of the data folder for images of a size in pixels."""
    return LooksOnce(open_detector(str(data_dir / "models" / "yolox_nano.onnx"), (width, height)))


@cache
def far_view(data_dir: Path, width: int, height: int) -> FarView | None:
    """Its second pass over the far part of the image, as on the command line."""
    network = open_detector(str(data_dir / "models" / "yolox_nano.onnx"), (width, height))
    far = open_far_view(network, (width, height))
    return replace(far, detector=LooksOnce(far.detector)) if far is not None else None


@cache
def lanes(uri: str, spec: str) -> LooksOnce[RawLanes] | None:
    """The lane detector for a recording, as on the command line; None if it is off."""
    detector = lanes_for(open_source(uri), spec)
    return None if detector is None else LooksOnce(detector)


@cache
def far_lanes(uri: str, spec: str) -> LooksOnce[RawLanes] | None:
    """The same for the far part of the images; None if the whole image shows as much."""
    whole = lanes(uri, spec)
    far = far_lanes_for(camera_of(open_source(uri)), whole.detector) if whole is not None else None
    return None if far is None else LooksOnce(far)
