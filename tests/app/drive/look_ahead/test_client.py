"""Networks in a process of their own: the same detections, at idle priority, and nothing is left of it."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np
import pytest

from app.drive.look_ahead import client
from app.drive.look_ahead.client import NetworkFailed, NetworkProcess, ProcessEnded, _file_of, is_worth_a_process
from app.drive.look_ahead.process import _opened
from pipeline.common.errors import BadInput
from pipeline.detection import Detectors
from pipeline.lanes.classical import open_classical
from pipeline.lanes.network import open_lane_network
from pipeline.types import RawBoxes, RawLanes
from pipeline.vision.detector import open_detector
from tests.app.drive.look_ahead.networks import COMMAND, both_views
from tests.app.engine.recording_helpers import CountingDetector, Recording
from tests.pipeline.lanes import lane_networks
from tests.pipeline.lanes.lane_cameras import camera_of
from tests.pipeline.recording.frames import same

WAIT_S = 180.0


@pytest.fixture(scope="module")
def detectors(tmp_path_factory: pytest.TempPathFactory) -> Detectors:
    return both_views(tmp_path_factory.mktemp("networks"))


@pytest.fixture(scope="module")
def process(detectors: Detectors) -> Iterator[NetworkProcess]:
    process = NetworkProcess(detectors)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(client, "_COMMAND", COMMAND)
        _detect(process)
    yield process
    process.close()


def test_detections_are_the_same_to_the_last_bit(process: NetworkProcess, detectors: Detectors) -> None:
    there = process.detectors
    assert there.names == detectors.names
    assert there.boxes is not None
    assert there.far is not None
    assert detectors.boxes is not None
    assert detectors.far is not None
    for index in (0, 20):
        frame = Recording().frame(index)
        assert frame.image is not None
        bgr = frame.image.bgr
        assert same(there.boxes.detect(bgr), detectors.boxes.detect(bgr))
        assert same(there.far.of(frame).detect(bgr), detectors.far.of(frame).detect(bgr))
    noise = np.random.default_rng(0).integers(0, 255, (180, 320, 3), np.uint8)
    assert same(there.boxes.detect(noise[:, ::-1]), detectors.boxes.detect(noise[:, ::-1])), "not contiguous"


def test_lanes_are_the_same_to_the_last_bit(data_dir: Path) -> None:
    lanes = open_lane_network(str(data_dir / "models" / "lstr_360x640.onnx"))
    process = NetworkProcess(Detectors(lanes=lanes))
    image = Recording().frame(0).image
    assert image is not None
    assert process.detectors.lanes is not None
    try:
        assert same(process.detectors.lanes.detect(image.bgr), lanes.detect(image.bgr))
    finally:
        process.close()


def test_the_far_part_is_the_same_to_the_last_bit(tmp_path: Path) -> None:
    wide = camera_of(721.5, 1242, 375, (610.0, 173.0))
    lanes = open_lane_network(str(lane_networks.twin(tmp_path / "twin.onnx", (360, 640))), camera=wide)
    far = lanes.far_of(wide)
    assert far is not None
    bgr = np.zeros((375, 1242, 3), np.uint8)
    bgr[160:, 600:603] = (0, 0, 255)
    assert len(far.detect(bgr).points) > 0
    process = NetworkProcess(Detectors(lanes=lanes, far_lanes=far))
    there = process.detectors
    assert there.names == (lanes.name, far.name)
    assert there.lanes is not None
    assert there.far_lanes is not None
    try:
        assert same(there.far_lanes.detect(bgr), far.detect(bgr))
        assert same(there.lanes.detect(bgr), lanes.detect(bgr))
    finally:
        process.close()


@pytest.mark.skipif(sys.platform != "linux", reason="idle scheduling is Linux's")
def test_all_its_threads_have_idle_priority_and_it_ends_with_the_server(
    detectors: Detectors, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()
    process = NetworkProcess(detectors)
    process._start()
    child = process._process
    assert child is not None
    assert child.stdin is not None
    threads = [int(each) for each in os.listdir(f"/proc/{child.pid}/task")]
    assert {os.sched_getscheduler(each) for each in threads} == {os.SCHED_IDLE}
    killed_first = Path(f"/proc/{child.pid}/oom_score_adj").read_text(encoding="ascii")
    assert killed_first.strip() == "1000", "before the server, if memory runs out"
    child.stdin.close()  # as the system does when the server ends, however it ends
    assert child.wait(WAIT_S) == 0
    process.close()


def test_what_is_not_a_network_stays_in_the_server() -> None:
    other = Detectors(CountingDetector(), open_classical(None))
    assert NetworkProcess(other).detectors == other


def test_only_networks_that_are_worth_it_get_a_process(detectors: Detectors) -> None:
    assert is_worth_a_process(detectors)
    assert not is_worth_a_process(Detectors(CountingDetector(), open_classical(None)))
    assert not is_worth_a_process(Detectors(open_detector("embedded", (320, 180))))
    on_a_card = replace(cast("Any", detectors.boxes), providers=("CUDAExecutionProvider", "CPUExecutionProvider"))
    assert not is_worth_a_process(replace(detectors, boxes=on_a_card))


def test_a_network_that_fails_says_why_and_the_next_image_is_looked_at(process: NetworkProcess) -> None:
    with pytest.raises(NetworkFailed, match=r"expected an image of \(H, W, 3\) uint8"):
        process.detect(0, np.zeros((0, 320, 3), np.uint8))
    assert _detect(process).model != ""


def test_a_file_that_was_replaced_is_not_used(detectors: Detectors) -> None:
    assert detectors.boxes is not None
    before = msgspec.structs.replace(_file_of(cast("Any", detectors.boxes)), name="what it was")
    with pytest.raises(BadInput, match=r"own\.onnx is not the network what it was any more"):
        _opened(before)


def test_it_can_be_ended_from_another_thread_and_leaves_no_pipe(tmp_path: Path) -> None:
    before = _descriptors()
    process = NetworkProcess(both_views(tmp_path))
    _detect(process)
    threading.Thread(target=process.end).start()
    with pytest.raises(ProcessEnded):
        _detect_for_ever(process)
    process.close()
    assert process._process is not None
    assert process._process.returncode is not None
    assert _descriptors() == before


def _detect(process: NetworkProcess) -> RawBoxes | RawLanes:
    image = Recording().frame(0).image
    assert image is not None
    return process.detect(0, image.bgr)


def _detect_for_ever(process: NetworkProcess) -> None:
    while True:
        _detect(process)


def _descriptors() -> int:
    folder = Path("/proc/self/fd")
    return len(list(folder.iterdir())) if folder.exists() else 0
