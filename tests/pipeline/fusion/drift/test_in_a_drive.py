"""The whole pipeline on a simulated drive in which the camera is knocked."""

from __future__ import annotations

import re

import pytest

from pipeline.params import Params
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.unseen import frames
from pipeline.step import State, step

SCENE = {
    "title": "a knock",
    "seed": 4,
    "duration_s": 14,
    "rate_hz": 10,
    "road": {"segments": [{"length_m": 1000}], "lanes_forward": 3},
    "ego": {"lane": -2, "speed_mps": {0: 12}},
    "detections": {"boxes": {}},
    "actors": [
        {"id": 1, "kind": "car", "lane": -2, "ahead_m": 22, "speed_mps": {0: 12}},
        {"id": 2, "kind": "car", "lane": -1, "ahead_m": 18, "speed_mps": {0: 12.3}},
        {"id": 3, "kind": "car", "lane": -3, "ahead_m": 26, "speed_mps": {0: 11.7}},
    ],
}


EMPTY = {**SCENE, "actors": [], "duration_s": 16, "detections": {"boxes": {}, "lines": {}}}


def notes(faults: dict[str, object], scene: dict[str, object] = SCENE) -> list[str]:
    """The notes about a turned mount, by frame."""
    state, found = State(), []
    for _, frame in frames(Scenario.model_validate({**scene, "faults": faults})):
        state, result = step(state, frame, Params())
        found.append(next((note for note in result.notes if "has turned" in note), ""))
    return found


def test_a_knock_is_said_with_its_angle_and_frame_and_nothing_else_is():
    found = notes({"knock": {"at_s": 6.0, "yaw_deg": 1.0}})
    assert not any(found[:60])
    told = re.search(r"since about frame (\d+): yaw ([+-][\d.]+)° .*pitch ([+-][\d.]+)°", found[-1])
    assert told is not None
    assert abs(int(told[1]) - 60) <= 10
    assert float(told[2]) == pytest.approx(1.0, abs=0.3)
    assert float(told[3]) == pytest.approx(0.0, abs=0.3)
    assert not any(notes({"camera_skew_ms": 60.0}))


@pytest.mark.parametrize("turned", [{"yaw_deg": -1.0}, {"pitch_deg": 1.0}], ids=str)
def test_lane_lines_show_a_knock_on_an_empty_road(turned: dict[str, float]):
    found = notes({"knock": {"at_s": 6.0, **turned}}, EMPTY)
    assert not any(found[:60])
    shown = r"(Camera.*) has turned since about frame (\d+): yaw ([+-][\d.]+)° .*pitch ([+-][\d.]+)°"
    told = re.search(shown, found[-1])
    assert told is not None
    assert told[1] == ("Camera" if "yaw_deg" in turned else "Camera or LiDAR")
    assert abs(int(told[2]) - 60) <= 10
    assert float(told[3]) == pytest.approx(turned.get("yaw_deg", 0.0), abs=0.3)
    assert float(told[4]) == pytest.approx(turned.get("pitch_deg", 0.0), abs=0.3)


def test_a_late_image_of_lines_is_no_turn():
    assert not any(notes({"camera_skew_ms": 60.0}, EMPTY))
