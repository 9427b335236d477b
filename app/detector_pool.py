"""The detectors for a source's pictures: opened once for each kind of picture, and what there is to say about them."""

from __future__ import annotations

from collections.abc import Callable

from app.snapshot import Notice
from pipeline.run import Detects, Sensors, picture_size
from pipeline.sources.base import AnySource, is_simulated
from pipeline.types import RawBoxes
from pipeline.vision.runtime import DetectorError, DetectorMissing

OpenDetector = Callable[[AnySource], Detects[RawBoxes]]


class DetectorPool:
    """``open_detector`` gives the one for a source's pictures; null: none, and nothing is said about it."""

    def __init__(self, open_detector: OpenDetector | None, sensors: Sensors) -> None:
        self._open = open_detector if sensors != "lidar" else None
        self._without = "LiDAR goes on alone." if sensors == "both" else "Without one the camera finds nothing."
        self._opened: dict[tuple[bool, tuple[int, int] | None], Detects[RawBoxes]] = {}

    def boxes_for(self, source: AnySource, notices: list[Notice]) -> Detects[RawBoxes] | None:
        """The detector of vehicles; where there is none, LiDAR goes on alone and a notice says so."""
        if self._open is None:
            return None
        kind = (is_simulated(source), picture_size(source))
        try:
            if kind not in self._opened:
                self._opened[kind] = self._open(source)
        except (DetectorMissing, DetectorError) as error:
            notices.append(Notice("warning", f"{error} {self._without}"))
            return None
        detector = self._opened[kind]
        notices += [Notice("warning", note) for note in detector.notes]
        return detector
