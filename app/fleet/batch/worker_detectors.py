"""The detectors of a worker, which runs many recordings one after another."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from app.fleet.batch.job import Job
from pipeline.detection import DetectorChoice, Detectors, far_lanes_for, image_size, open_detectors
from pipeline.lanes.open_detector import LaneDetector, usual_every
from pipeline.run import patiently
from pipeline.types.source import Source, is_simulated

_KINDS = 4
"""Kinds of image whose networks stay open, at 20 MB each with YOLOX-nano alone. Opening them again takes as long as
processing several images."""


def detectors_for(source: Source, job: Job) -> Detectors:
    """The detectors for a recording. Networks are opened once per kind of image, whatever the camera's calibration,
    which differs from car to car."""
    if job.key.sensors == "lidar":
        return Detectors()
    first = patiently(source, 0)
    if first.detections_given:
        return Detectors()
    opened = _opened(_Opening(source, (is_simulated(source), image_size(source))), job.choice, job.key.sensors)
    if not isinstance(opened.lanes, LaneDetector):
        return opened
    lanes = opened.lanes.of_camera(first.camera)
    far_lanes = far_lanes_for(first.camera, opened.far_lanes or opened.lanes, job.choice.far_px)
    every = job.choice.lanes_every or usual_every(lanes, source.rate_hz)
    return replace(opened, lanes=lanes, lanes_every=every, far_lanes=far_lanes)


class _Opening:
    """A source that is equal to all others of its kind, for the cache below."""

    def __init__(self, source: Source, kind: tuple[object, ...]) -> None:
        self.source, self._kind = source, kind

    def __hash__(self) -> int:
        return hash(self._kind)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Opening) and self._kind == other._kind


@lru_cache(maxsize=_KINDS)
def _opened(opening: _Opening, choice: DetectorChoice, sensors: str) -> Detectors:
    detectors = open_detectors(opening.source, choice, sensors)
    del opening.source  # only its kind is held
    return detectors
