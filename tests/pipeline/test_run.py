"""Which network sees which pictures."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.run import detector_for
from pipeline.sources import open_source
from pipeline.vision.models import EMBEDDED, find, register
from tests.pipeline.vision import networks


@pytest.fixture
def _own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("CIPV_HOME", "CIPV_DATA"):
        monkeypatch.setenv(variable, str(tmp_path / variable))


@pytest.mark.usefixtures("_own_folders")
def test_the_simulator_is_seen_by_the_embedded_detector_unless_another_is_named(tmp_path: Path) -> None:
    register(networks.yolox(tmp_path / "mine.onnx"), "mine")
    source = open_source("sim:straight")
    drawn = detector_for(source)
    embedded = find(EMBEDDED)
    assert embedded is not None
    assert drawn.name.startswith(embedded.stem)
    assert (drawn.input_size, drawn.notes) == ((384, 640), ())
    assert detector_for(source, "mine").name.startswith("mine")


@pytest.mark.usefixtures("_own_folders")
def test_a_recording_is_seen_by_the_default_one(tmp_path: Path) -> None:
    source = open_source("sim:straight")
    source.uri = "astyx:elsewhere"
    assert "simulated cars only" in detector_for(source).notes[0]
    register(networks.yolox(tmp_path / "mine.onnx"), "mine")
    assert detector_for(source).name.startswith("mine")
