"""The pipeline gives the same results for a session as for the recording that it was made from."""

from __future__ import annotations

from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from pipeline.detection import Detectors, detector_for
from pipeline.params import Params
from pipeline.recording.save import save
from pipeline.run import run
from pipeline.sources import open_source
from pipeline.types.result_json import to_json
from pipeline.types.source import Source
from pipeline.vision.detector import open_detector


def believed(source: Source, detectors: Detectors, frames: int) -> list[dict[str, Any]]:
    """Results without timing."""
    results = [to_json(result) for _, result in islice(run(source, Params(), detectors), frames)]
    return [{key: value for key, value in result.items() if key != "timing_ms"} for result in results]


def imported(source: Source, tmp_path: Path, frames: int) -> Source:
    save(source, tmp_path / "a.mcap", 0, frames - 1)
    return open_source(str(tmp_path / "a.mcap"))


@pytest.mark.parametrize(("kind", "folder", "frames"), [("astyx", "astyx", 8), ("kitti", "kitti_0052", 3)])
def test_real_recordings(kind: str, folder: str, frames: int, data_dir: Path, tmp_path: Path) -> None:
    """JPEGs of Astyx and PNGs of KITTI, each with its calibration."""
    source = open_source(f"{kind}:{data_dir / folder}")
    session = imported(source, tmp_path, frames)
    detectors = Detectors(open_detector(str(data_dir / "models" / "yolox_nano.onnx"), None))
    expected = believed(source, detectors, frames)
    assert any(result["objects"] for result in expected)
    assert believed(session, detectors, frames) == expected
    assert [session.truth(index) for index in range(frames)] == [source.truth(index) for index in range(frames)]


def test_the_simulator(tmp_path: Path) -> None:
    """With ego motion and GNSS, and the detector for the simulator's images."""
    source = open_source("sim:straight")
    session = imported(source, tmp_path, frames=4)
    detector = detector_for(session)
    assert detector.name == detector_for(source).name
    expected = believed(source, Detectors(detector), 4)
    assert any(result["objects"] for result in expected)
    assert believed(session, Detectors(detector), 4) == expected
