"""The form of the detector benchmark's figures, and that it alternates fairly; speed itself is left to the
benchmark."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from app.bench.detector import stages
from app.bench.timing import interleaved
from pipeline.types import U8, CameraImage, Frame, RawBoxes
from pipeline.vision.detector import open_detector
from pipeline.vision.far_view import WindowDetector, open_far_view
from tests.pipeline.vision import networks


class _Noted:
    """A detector that notes the shapes of its images."""

    def __init__(self, detector: WindowDetector, asked: list[tuple[int, ...]]) -> None:
        self._detector, self._asked, self.name = detector, asked, detector.name

    def detect(self, bgr: U8) -> RawBoxes:
        self._asked.append(bgr.shape)
        return self._detector.detect(bgr)


def _frame(width: int = 128) -> Frame:
    return Frame(0, 0, "0", image=CameraImage(None, np.zeros((128, width, 3), np.uint8)))


def test_the_figures_have_the_contracts_form(tmp_path: Path) -> None:
    detector = open_detector(str(networks.yolox(tmp_path / "tiny.onnx")), (128, 128))
    measured = stages([_frame()] * 2, detector, 0.0)
    assert list(measured) == ["detector"]
    figures = measured["detector"]
    assert figures["model"] == detector.name
    assert figures["p99_ms"] >= figures["median_ms"] > 0
    assert figures["peers"].keys() == {"cv2.dnn"}
    assert figures["peers"]["cv2.dnn"].keys() == {"median_ms", "ratio"}


def test_a_peer_that_cannot_run_the_graph_is_named_with_its_reason(tmp_path: Path) -> None:
    detector = open_detector(str(networks.yolov8(tmp_path / "tiny.onnx")), (128, 128))
    peer = stages([_frame()], detector, 0.0)["detector"]["peers"]["cv2.dnn"]
    assert (peer["median_ms"], peer["ratio"]) == (None, None)
    assert peer["absent"].startswith("OpenCV cannot run this graph: ")
    assert "\n" not in peer["absent"]


def test_the_far_view_is_a_row_of_its_own(tmp_path: Path) -> None:
    detector = open_detector(str(networks.yolox(tmp_path / "tiny.onnx")), (128, 512))
    far = open_far_view(detector, (512, 128), 64)
    assert far is not None
    asked: list[tuple[int, ...]] = []
    noted = replace(far, detector=_Noted(far.detector, asked))
    measured = stages([_frame(512)], detector, 0.0, noted)
    assert list(measured) == ["detector", "far_view"]
    assert set(asked) == {(64, 64, 3)}
    row = measured["far_view"]
    assert row["p99_ms"] >= row["median_ms"] > 0
    assert 0 < row["samples"] < len(asked)
    assert row["model"].endswith("-far64")


def test_without_images_there_is_nothing_to_measure(tmp_path: Path) -> None:
    detector = open_detector(str(networks.yolox(tmp_path / "tiny.onnx")), None)
    assert stages([], detector, 0.0) == stages([Frame(0, 0, "0")], detector, 0.0) == {}


def test_contestants_take_turns() -> None:
    calls: list[str] = []
    times = interleaved({"a": lambda: calls.append("a"), "b": lambda: calls.append("b")}, 0.0)
    assert {name: len(spent) >= 3 for name, spent in times.items()} == {"a": True, "b": True}
    assert calls[:4] == ["a", "a", "b", "b"]
    turns = [name for name, before in zip(calls[4:], ["", *calls[4:]], strict=False) if name != before]
    assert turns == ["a", "b"] * 3
