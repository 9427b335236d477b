"""The detectors for a source's images, opened once for each kind of image, and their notes.

Lane detectors are opened again for each source, because the classical one depends on the camera; that takes only a
moment."""

from __future__ import annotations

from collections.abc import Callable

from app.engine.snapshot import Notice
from pipeline.detection import Detectors, Detects, brings_detections, camera_of, far_lanes_for, far_view_for, image_size
from pipeline.inference.runtime import DetectorError, DetectorMissing
from pipeline.lanes.open_detector import usual_every
from pipeline.run import Sensors
from pipeline.types import RawBoxes, RawLanes
from pipeline.types.source import AnySource, is_simulated
from pipeline.vision.far_view import FarView

OpenDetector = Callable[[AnySource], Detects[RawBoxes]]
OpenLanes = Callable[[AnySource], Detects[RawLanes] | None]

_Kind = tuple[bool, tuple[int, int] | None]

ABLATION_NOTICES: dict[Sensors, tuple[str, ...]] = {
    "both": (),
    "lidar": ("LiDAR only: no detection in the images",),
    "camera": ("Camera only: LiDAR points are not used",),
}
"""Notices about disabled sensors."""


class DetectorPool:
    """``open_detector`` and ``open_lanes`` return the detectors for a source's images; None: no detector, without a
    notice. lanes_every: lanes are detected in every n-th frame; None: depends on the lane detector's speed.
    far_view_px: side of the far view's window; None: no far view, of lanes neither."""

    def __init__(
        self,
        open_detector: OpenDetector | None,
        sensors: Sensors,
        open_lanes: OpenLanes | None = None,
        lanes_every: int | None = None,
        far_view_px: int | None = None,
    ) -> None:
        self._open_lanes = open_lanes if sensors != "lidar" else None
        self._lanes_every = lanes_every
        self._far_view_px = far_view_px
        self._open = open_detector if sensors != "lidar" else None
        self._without = "Running on LiDAR alone." if sensors == "both" else "Without it, no object can be detected."
        self._opened: dict[_Kind, Detects[RawBoxes]] = {}
        self._opened_far: dict[_Kind, FarView | None] = {}

    def forget(self) -> None:
        """Reopen all detectors at the next request, because one of them hangs."""
        self._opened, self._opened_far = {}, {}

    def both_for(self, source: AnySource, notices: list[Notice]) -> Detectors:
        """The detectors for the source's images; a missing one is None, with a notice. Empty if the source contains
        detections."""
        if brings_detections(source):
            return Detectors()
        lanes = self.lanes_for(source, notices)
        boxes = self.boxes_for(source, notices)
        every = self._lanes_every or usual_every(lanes, source.rate_hz)
        far_lanes = far_lanes_for(camera_of(source), lanes, self._far_view_px)
        return Detectors(boxes, lanes, every, self.far_view_for(source, boxes), far_lanes=far_lanes)

    def far_view_for(self, source: AnySource, boxes: Detects[RawBoxes] | None) -> FarView | None:
        """The detector's second pass for the source's images; None if it is disabled or adds nothing."""
        if boxes is None:
            return None  # not kept: the detector may be there the next time
        kind = _kind_of(source)
        if kind not in self._opened_far:
            self._opened_far[kind] = far_view_for(source, boxes, self._far_view_px)
        return self._opened_far[kind]

    def lanes_for(self, source: AnySource, notices: list[Notice]) -> Detects[RawLanes] | None:
        """The lane detector, which is named in a notice."""
        if self._open_lanes is None:
            return None
        try:
            lanes = self._open_lanes(source)
        except (DetectorMissing, DetectorError) as error:
            notices.append(Notice("warning", f"{error} No lane detection."))
            return None
        notices += [Notice("info", note) for note in lanes.notes] if lanes is not None else []
        return lanes

    def boxes_for(self, source: AnySource, notices: list[Notice]) -> Detects[RawBoxes] | None:
        """The vehicle detector; without one, only the LiDAR is used and a notice says so."""
        if self._open is None:
            return None
        kind = _kind_of(source)
        try:
            if kind not in self._opened:
                self._opened[kind] = self._open(source)
        except (DetectorMissing, DetectorError) as error:
            notices.append(Notice("warning", f"{error} {self._without}"))
            return None
        detector = self._opened[kind]
        notices += [Notice("warning", note) for note in detector.notes]
        return detector


def _kind_of(source: AnySource) -> _Kind:
    """Properties of a source that a detector depends on: sources of equal kind share it."""
    return is_simulated(source), image_size(source)
