"""A hundred thousand labels in one drive: each format writes them within ten seconds."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.common.geometry import Cuboid
from pipeline.labels.formats.base import FrameInfo, LabeledDrive
from pipeline.labels.formats.registry import FORMATS, FormatName, export_labels, import_labels
from pipeline.labels.model import LabelSet, LabelTrack, LeadRange, Sighting
from tests.pipeline.labels.formats.sets import IMPORT, camera

pytestmark = pytest.mark.soak
TRACKS, FRAMES = 50, 2000
LIMIT_S = 10.0


@pytest.fixture(scope="module")
def drive() -> LabeledDrive:
    eye = camera()
    shots = (FrameInfo(f"{i:06d}", i * 10**8, eye, (1280, 720), eye.T_camera_ego) for i in range(FRAMES))
    return LabeledDrive("sim:long", tuple(shots))


@pytest.fixture(scope="module")
def labels(drive: LabeledDrive) -> LabelSet:
    tracks = []
    for number in range(TRACKS):
        cuboid = Cuboid((10.0 + number, 0.0, 0.5), (4.0, 1.8, 1.5), 0.1)
        seen = tuple(Sighting(i, cuboid, (560.0, 300.0, 700.0, 420.0)) for i in range(FRAMES))
        tracks.append(LabelTrack(number, "car", seen, "accepted", IMPORT))
    leads = tuple(LeadRange(i, i, i % TRACKS, "accepted", IMPORT) for i in range(FRAMES))
    return replace(drive.empty(), tracks=tuple(tracks), leads=leads)


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "mcap"])
def test_a_hundred_thousand_labels(name: FormatName, labels: LabelSet, drive: LabeledDrive, tmp_path: Path) -> None:
    began = time.perf_counter()
    export_labels(labels, drive, name, tmp_path / "out")
    assert time.perf_counter() - began < LIMIT_S
    back = import_labels(tmp_path / "out", drive, name, IMPORT).labels
    assert sum(len(track.sightings) for track in back.tracks) == (TRACKS * FRAMES if name != "csv" else 0)
