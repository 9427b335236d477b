"""The detectors of a worker, which runs many recordings one after another."""

from __future__ import annotations

from functools import lru_cache

from app.fleet.batch.job import Job
from pipeline.detection import DetectorChoice, Detectors, image_size, open_detectors
from pipeline.run import patiently
from pipeline.types.source import Source, is_simulated


def detectors_for(source: Source, job: Job) -> Detectors:
    """The detectors for a recording. Networks are opened once per kind of image and, for the classical lane detector,
    camera."""
    if job.key.sensors == "lidar":
        return Detectors()
    first = patiently(source, 0)
    camera = first.camera
    numbers = () if camera is None else (camera.K.tobytes(), camera.T_camera_ego.tobytes(), camera.road_z_m)
    kind = (is_simulated(source), image_size(source), source.rate_hz, first.detections_given, numbers)
    return _opened(_Opening(source, kind), job.choice, job.key.sensors)


class _Opening:
    """A source that is equal to all others of its kind, for the cache below."""

    def __init__(self, source: Source, kind: tuple[object, ...]) -> None:
        self.source, self._kind = source, kind

    def __hash__(self) -> int:
        return hash(self._kind)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Opening) and self._kind == other._kind


@lru_cache(maxsize=2)
def _opened(opening: _Opening, choice: DetectorChoice, sensors: str) -> Detectors:
    detectors = open_detectors(opening.source, choice, sensors)
    del opening.source  # only its kind is held
    return detectors
