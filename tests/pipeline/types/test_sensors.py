"""Sensors by their letters: sources, capabilities, words. With a third sensor, existing sources keep their numbers."""

from __future__ import annotations

import pytest

from pipeline.types import most_sensors_first, object_sources, seeing_sensors_in_words, sensors_in_words
from pipeline.types.sensors import is_camera_in, is_lidar_in, is_ranging_in, joined
from tests.pipeline.ranging.declared import radar_declared


def test_sources_keep_their_numbers_when_a_sensor_is_added() -> None:
    assert object_sources() == ("V", "L", "VL")
    assert most_sensors_first() == ("VL", "V", "L")
    with radar_declared():
        assert object_sources() == ("V", "L", "VL", "R", "VR", "LR", "VLR")
        assert most_sensors_first()[0] == "VLR"
    assert object_sources() == ("V", "L", "VL")


def test_letters_are_joined_in_order() -> None:
    assert joined("L", "V") == "VL"
    with radar_declared():
        assert joined("R", "VL") == joined("LR", "V") == "VLR"


def test_capabilities() -> None:
    with radar_declared():
        assert [is_ranging_in(each) for each in ("V", "L", "R", "VR", "")] == [False, True, True, True, False]
        assert [is_camera_in(each) for each in ("V", "LR")] == [True, False]
        assert [is_lidar_in(each) for each in ("R", "LR")] == [False, True]
    assert not is_ranging_in("R")


@pytest.mark.parametrize(
    ("source", "words", "seeing"),
    [
        ("V", "camera only", "the camera"),
        ("L", "LiDAR only", "the LiDAR"),
        ("VL", "both sensors", "both sensors"),
        ("R", "radar only", "the radar"),
        ("VR", "camera and radar", "camera and radar"),
        ("VLR", "camera, LiDAR and radar", "camera, LiDAR and radar"),
        ("", "", "no sensor"),
    ],
)
def test_words(source: str, words: str, seeing: str) -> None:
    with radar_declared():
        assert (sensors_in_words(source), seeing_sensors_in_words(source)) == (words, seeing)
