"""The form of the detector benchmark's figures, and that it alternates fairly; speed itself is left to the
benchmark."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from app.bench.detector import stages
from app.bench.timing import interleaved
from pipeline.vision.detector import open_detector
from tests.pipeline.vision import networks


def test_the_figures_have_the_contracts_form(tmp_path: Path) -> None:
    detector = open_detector(str(networks.yolox(tmp_path / "tiny.onnx")), (128, 128))
    figures = stages([np.zeros((128, 128, 3), np.uint8)] * 2, detector, 0.0)["detector"]
    assert figures["model"] == detector.name
    assert figures["p99_ms"] >= figures["median_ms"] > 0
    assert figures["peers"].keys() == {"cv2.dnn"}
    assert figures["peers"]["cv2.dnn"].keys() == {"median_ms", "ratio"}


def test_a_peer_that_cannot_run_the_graph_is_named_with_its_reason(tmp_path: Path) -> None:
    detector = open_detector(str(networks.yolov8(tmp_path / "tiny.onnx")), (128, 128))
    peer = stages([np.zeros((128, 128, 3), np.uint8)], detector, 0.0)["detector"]["peers"]["cv2.dnn"]
    assert (peer["median_ms"], peer["ratio"]) == (None, None)
    assert peer["absent"].startswith("OpenCV cannot run this graph: ")
    assert "\n" not in peer["absent"]


def test_without_images_there_is_nothing_to_measure(tmp_path: Path) -> None:
    assert stages([], open_detector(str(networks.yolox(tmp_path / "tiny.onnx")), None), 0.0) == {}


def test_contestants_take_turns() -> None:
    calls: list[str] = []
    times = interleaved({"a": lambda: calls.append("a"), "b": lambda: calls.append("b")}, 0.0)
    assert {name: len(spent) >= 3 for name, spent in times.items()} == {"a": True, "b": True}
    assert calls[:4] == ["a", "a", "b", "b"]
    turns = [name for name, before in zip(calls[4:], ["", *calls[4:]], strict=False) if name != before]
    assert turns == ["a", "b"] * 3
