"""Which network sees which images."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.detection import Detectors, detect, detector_for, lanes_for
from pipeline.inference.model_registry import EMBEDDED, find, register
from pipeline.params import Params
from pipeline.run import advance, run
from pipeline.sources import open_source
from pipeline.step import State
from pipeline.types import U8, CameraImage, Frame, RawBoxes, RawLanes
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
    source.is_simulated = False  # type: ignore[attr-defined]
    assert "simulated cars only" in detector_for(source).notes[0]
    register(networks.yolox(tmp_path / "mine.onnx"), "mine")
    assert detector_for(source).name.startswith("mine")


def test_nothing_looks_for_lanes_in_a_recording_without_images() -> None:
    source = open_source("sim:straight")
    first = source.frame(0)
    assert lanes_for(source) is not None
    source.frame = lambda index: replace(first, image=None, camera=None)  # type: ignore[method-assign]
    assert lanes_for(source) is None
    assert lanes_for(source, "classical") is not None, "whoever names one gets it"


class _Seen:
    """A detector that records the images that it processed."""

    notes = ()

    def __init__(self, answer: RawBoxes | RawLanes) -> None:
        self.name, self.answer, self.calls = answer.model, answer, 0

    def detect(self, bgr: U8) -> RawBoxes | RawLanes:
        self.calls += 1
        return self.answer


_NO_BOXES = RawBoxes("boxes", np.zeros((0, 4), np.float32), np.zeros(0, np.float32), ())
_NO_LANES = RawLanes("lanes", np.zeros((0, 2), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32))


def _frames(count: int) -> list[Frame]:
    image = CameraImage(0, np.zeros((36, 64, 3), np.uint8))
    return [Frame(i, f"{i}", i * 100_000_000, image=image) for i in range(count)]


def test_lanes_are_looked_for_in_every_nth_frame_and_boxes_in_all() -> None:
    boxes, lanes = _Seen(_NO_BOXES), _Seen(_NO_LANES)
    seen = [detect(frame, Detectors(boxes, lanes, lanes_every=3)) for frame in _frames(7)]
    assert (boxes.calls, lanes.calls) == (7, 3)
    assert [frame.index for frame in seen if frame.raw_lanes is not None] == [0, 3, 6]


def test_the_far_part_of_the_image_has_every_second_turn_of_the_lanes() -> None:
    """By the frame's index, so that a frame's lines do not depend on the order in which frames are read."""
    lanes, far = _Seen(_NO_LANES), _Seen(replace(_NO_LANES, model="far"))
    asked = Detectors(None, lanes, lanes_every=3, far_lanes=far)
    seen = [detect(frame, asked).raw_lanes for frame in reversed(_frames(10))]
    assert [each and each.model for each in reversed(seen)] == [
        *("lanes", None, None, "far", None, None, "lanes", None, None, "far"),
    ]
    assert asked.names == ("lanes", "far"), "caches and tables tell them apart"


def test_a_car_with_lidar_alone_asks_no_detector() -> None:
    boxes, lanes = _Seen(_NO_BOXES), _Seen(_NO_LANES)
    frame, _, result, _ = advance(State(), _frames(1)[0], Params(), Detectors(boxes, lanes), "lidar")
    assert (boxes.calls, lanes.calls) == (0, 0)
    assert frame.raw_boxes is None
    assert frame.raw_lanes is None
    assert result.layers.lanes is None


def test_a_camera_without_an_image_is_not_asked() -> None:
    lanes = _Seen(_NO_LANES)
    frame = replace(_frames(1)[0], image=None)
    assert detect(frame, Detectors(None, lanes)) is frame
    assert lanes.calls == 0


def test_the_line_believes_the_simulators_lane_by_the_classical_detector() -> None:
    source = open_source("sim:straight")
    lanes = lanes_for(source)
    assert lanes is not None
    assert lanes.name.startswith("classical")
    _, _, result, _ = advance(State(), source.frame(0), Params(), Detectors(None, lanes))
    lane = result.layers.lanes
    assert lane is not None
    assert lane.width_m == pytest.approx(3.6, abs=0.2)
    assert lanes_for(source, "off") is None


def test_the_next_frame_is_read_while_one_is_processed() -> None:
    source = open_source("sim:straight")
    read = source.frame
    second = threading.Event()

    def frame(index: int) -> Frame:
        if index == 1:
            second.set()
        return replace(read(index), image=None)

    source.frame = frame  # type: ignore[method-assign]
    results = run(source, Params(), Detectors())
    next(results)
    assert second.wait(60.0)
    results.close()
