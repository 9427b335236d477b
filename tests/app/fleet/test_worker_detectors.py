"""The networks of a worker stay open from recording to recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from app.fleet.batch.worker_detectors import detectors_for
from pipeline.common.fast_replace import evolve
from pipeline.detection import DetectorChoice, open_detectors
from pipeline.sources import open_source
from pipeline.types import Frame
from pipeline.types.source import Source
from tests.app.fleet.fleets import job_of


class OtherCamera:
    """The same recording by a car whose camera points a little higher."""

    def __init__(self, source: Source) -> None:
        self._source = source

    def __getattr__(self, name: str) -> object:
        return getattr(self._source, name)

    def frame(self, index: int) -> Frame:
        frame = self._source.frame(index)
        assert frame.camera is not None
        K = frame.camera.K.copy()
        K[1, 2] += 20.0
        return replace(frame, camera=evolve(frame.camera, K=K))


@pytest.mark.parametrize("lanes", [None, "off"])
def test_networks_stay_open_whatever_the_calibration(fleet: Path, tmp_path: Path, lanes: str | None):
    job = replace(job_of(str(fleet / "near-0.mcap"), tmp_path), choice=DetectorChoice(lanes=lanes))
    source = open_source(str(fleet / "near-0.mcap"))
    other = OtherCamera(source)
    first, second = detectors_for(source, job), detectors_for(other, job)  # type: ignore[arg-type]
    assert first.boxes is second.boxes
    assert first.far is second.far
    expected = open_detectors(other, job.choice)  # type: ignore[arg-type]
    assert second.names == expected.names
    assert second.lanes_every == expected.lanes_every
    assert second.lanes == expected.lanes
    assert (first.names != second.names) == (lanes is None), "the rows that lanes are searched in follow the camera"
