"""Detections that come with a recording, stored in its ticks. Detections of networks are not stored: any network can
process the session's images again. Detections that are part of a drive are stored number for number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.recording.errors import Damaged
from pipeline.types import DistanceLaw, Frame, RawBoxes, RawLanes


@dataclass(frozen=True)
class BoxesRecord:
    """``RawBoxes`` with arrays as rows of numbers."""

    model: str
    """Name of the detector that found them."""
    boxes: tuple[tuple[float, float, float, float], ...]
    """x1 y1 x2 y2 in pixels."""
    scores: tuple[float, ...]
    """0–1, one per box."""
    labels: tuple[str, ...]
    """Class names, one per box."""
    law: DistanceLaw
    """Law for computing distances from these boxes."""

    def raw(self) -> RawBoxes:
        """Damaged if scores or classes are missing for boxes."""
        if not len(self.boxes) == len(self.scores) == len(self.labels):
            raise Damaged("the given boxes cannot be read")
        boxes = np.array(self.boxes, np.float32).reshape(-1, 4)
        return RawBoxes(self.model, boxes, np.array(self.scores, np.float32), self.labels, self.law)


@dataclass(frozen=True)
class LanesRecord:
    """``RawLanes`` with arrays as rows of numbers."""

    model: str
    """Name of the detector that found them."""
    points: tuple[tuple[float, float], ...]
    """x, y in pixels."""
    scores: tuple[float, ...]
    """0–1, one per point."""
    line: tuple[int, ...]
    """Number of the line that each point is on."""

    def raw(self) -> RawLanes:
        """Damaged if scores or lines are missing for points."""
        if not len(self.points) == len(self.scores) == len(self.line):
            raise Damaged("the given lane lines cannot be read")
        points = np.array(self.points, np.float32).reshape(-1, 2)
        return RawLanes(self.model, points, np.array(self.scores, np.float32), np.array(self.line, np.int32))


@dataclass(frozen=True)
class Given:
    """The detections contained in a frame."""

    boxes: BoxesRecord | None = None
    """None if there was no vehicle detection."""
    lanes: LanesRecord | None = None
    """None if there was no lane detection."""


def given_of(frame: Frame) -> Given | None:
    """None for a frame without recorded detections."""
    if not frame.detections_given:
        return None
    return Given(
        _boxes(frame.raw_boxes) if frame.raw_boxes is not None else None,
        _lanes(frame.raw_lanes) if frame.raw_lanes is not None else None,
    )


def _boxes(raw: RawBoxes) -> BoxesRecord:
    boxes = tuple((x1, y1, x2, y2) for x1, y1, x2, y2 in raw.boxes.tolist())
    return BoxesRecord(raw.model, boxes, tuple(raw.scores.tolist()), raw.labels, raw.law)


def _lanes(raw: RawLanes) -> LanesRecord:
    points = tuple((u, v) for u, v in raw.points.tolist())
    return LanesRecord(raw.model, points, tuple(raw.scores.tolist()), tuple(raw.line.tolist()))
