"""The benchmark of the whole step: alone, beside a running network, and including it."""

from __future__ import annotations

import threading
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from app.bench import whole_pipeline
from app.commands.bench import _absent, _table
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types import U8, RawBoxes, RawLanes
from pipeline.vision.detector import Detector, open_detector
from pipeline.vision.far_view import open_far_view
from tests.pipeline.vision import networks


class Paint:
    """A lane detector that counts the images."""

    name = "paint"

    def __init__(self) -> None:
        self.asked = 0

    def detect(self, bgr: U8) -> RawLanes:
        self.asked += 1
        return RawLanes(self.name, np.zeros((0, 2), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32))


def test_the_step_is_measured_alone_and_beside_the_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = open_source("sim:straight")
    detector = open_detector(str(networks.yolox(tmp_path / "tiny.onnx")), (128, 128))
    asked: set[tuple[str, int]] = set()
    look = Detector.detect

    def noting(self: Detector, bgr: U8) -> RawBoxes:
        where = "here" if threading.current_thread() is threading.main_thread() else "beside"
        asked.add((where, bgr.shape[0]))
        return look(self, bgr)

    monkeypatch.setattr(Detector, "detect", noting)
    lanes = Paint()
    far = open_far_view(detector, (1280, 720), 128)
    assert far is not None
    figures = whole_pipeline.stages(source, 3, Params(), Detectors(detector, lanes, 2, far), 0.4)
    assert list(figures) == ["lidar_branch", "step", "step_beside_network", "line"]
    assert asked == {(where, height) for where in ("here", "beside") for height in (720, 128)}, "both views"
    assert lanes.asked > 0
    assert (figures["line"]["lanes"], figures["line"]["lanes_every"]) == ("paint", 2)
    assert figures["line"]["far_view"] == far.name
    for row in figures.values():
        assert 0.0 < row["median_ms"] <= row["p99_ms"]
        assert row["samples"] >= 1
    assert figures["step"]["cpu_ms"] > 0.0
    assert figures["lidar_branch"]["cpu_ms"] > 0.0
    beside = figures["step_beside_network"]
    ratio = beside["p99_ms"] / figures["step"]["median_ms"]
    assert beside["p99_to_idle_median"] == pytest.approx(ratio, abs=0.01)
    printed = StringIO()
    Console(width=160, file=printed).print(_table(figures))
    assert f"p99 is {beside['p99_to_idle_median']:.1f} × the idle step's median" in printed.getvalue()
    assert all(f" {row['samples']} " in printed.getvalue() for row in figures.values())


def test_why_peers_are_absent_is_said_once_below_the_table() -> None:
    peer = {"median_ms": None, "ratio": None, "absent": "no library: nowhere"}
    row = {"median_ms": 1.0, "p99_ms": 2.0, "samples": 3, "peers": {"open3d": peer, "voxels": peer}}
    assert list(_absent({"one": row, "two": row})) == ["Absent: open3d; voxels: no library: nowhere"]
    printed = StringIO()
    Console(width=80, file=printed).print(_table({"one": row}))
    assert "absent" in printed.getvalue()
    assert "nowhere" not in printed.getvalue()


def test_each_round_goes_on_where_the_last_one_ended() -> None:
    source = open_source("sim:straight")
    steps = whole_pipeline._Steps(iter([source.frame(0), source.frame(1)] * 1000), Params())
    for _ in range(2):
        steps.go_on(0.0)
    assert len(steps.rest.times_s) == 1, "one frame at least, however short the time"
    steps.go_on(0.05)
    row = steps.rest.row()
    assert row["samples"] == len(steps.rest.times_s) == len(steps.branch.times_s) > 1
    assert row["median_ms"] == pytest.approx(float(np.median(steps.rest.times_s)) * 1e3)
