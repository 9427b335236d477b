"""Boxes without a network: where the vehicles are, none for the hidden and the far, wrong by as much as said."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.geometry import iou_matrix
from pipeline.simulation.sensors import truth_boxes
from pipeline.simulation.sensors.camera import calibration
from pipeline.simulation.sensors.detection_model import BoxNoise
from pipeline.simulation.world import world_state
from pipeline.types import RawBoxes
from tests.pipeline.simulation.worlds import with_actors

PERFECT = BoxNoise(lasting_share=0.0, frame_share=0.0, edge_px=0.0, missed=0.0)


def look(actors: str, noise: BoxNoise = PERFECT, seed: int = 1, index: int = 0) -> RawBoxes:
    scene = with_actors(actors)
    return truth_boxes.boxes(world_state.at(scene, 0.0), calibration(scene.camera), noise, seed, index)


def car(number: int, ahead_m: float, lane: int = -2, kind: str = "car") -> str:
    return f"{{id: {number}, kind: {kind}, lane: {lane}, ahead_m: {ahead_m}, speed_mps: {{0: 20}}}}"


def test_a_box_is_as_high_as_the_pinhole_makes_it() -> None:
    (box,) = look(car(1, 40.0)).boxes.tolist()
    camera = calibration(with_actors().camera)
    assert box[3] - box[1] == pytest.approx(camera.K[1, 1] * 1.48 / 41.6, rel=0.02)
    assert (box[0] + box[2]) / 2 == pytest.approx(camera.K[0, 2], abs=2.0)


@pytest.mark.parametrize(
    ("actors", "labels"),
    [
        pytest.param(car(1, 30.0), ("car",), id="ahead"),
        pytest.param(car(1, -30.0), (), id="behind"),
        pytest.param(car(1, 150.0), (), id="too far"),
        pytest.param(car(1, 20.0) + "," + car(2, 60.0), ("car",), id="hidden behind another"),
        pytest.param(car(1, 30.0) + "," + car(2, 30.0, -1, "truck"), ("car", "truck"), id="side by side"),
        pytest.param(car(1, 30.0, kind="van"), ("car",), id="a van is a car to a network taught on COCO"),
    ],
)
def test_who_is_seen(actors: str, labels: tuple[str, ...]) -> None:
    assert tuple(sorted(look(actors).labels)) == labels


def test_noise_is_as_large_as_said_and_partly_stays_with_a_vehicle() -> None:
    noise = BoxNoise(lasting_share=0.02, frame_share=0.01, edge_px=0.0, missed=0.0)
    (truth,) = look(car(1, 25.0)).boxes.tolist()
    height = truth[3] - truth[1]
    off = np.array([
        [np.array(look(car(1, 25.0), noise, seed, index).boxes[0]) - truth for index in range(20)]
        for seed in range(20)
    ])  # fmt: skip
    assert off.std(axis=1).mean() == pytest.approx(0.01 * height, rel=0.15)
    assert off.mean(axis=1).std() == pytest.approx(0.02 * height, rel=0.3)


def test_as_many_are_missed_as_said() -> None:
    noise = BoxNoise(missed=0.3, reach_m=1000.0)
    seen = sum(len(look(car(1, 25.0), noise, index=index).labels) for index in range(300))
    assert seen / 300 == pytest.approx(0.7, abs=0.08)


def test_the_same_moment_gives_the_same_boxes() -> None:
    a, b = (look(car(1, 25.0), BoxNoise(), 3, 7) for _ in range(2))
    np.testing.assert_array_equal(a.boxes, b.boxes)
    other = look(car(1, 25.0), BoxNoise(), 3, 8)
    assert 0.7 < iou_matrix(a.boxes, other.boxes)[0, 0] < 1.0
