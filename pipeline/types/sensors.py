"""Which sensors see an object, as in results: one letter for each sensor, and the capabilities behind the letters.

Stages ask an object for its capabilities (``FusedObject.ranged``); only code that reads stored rows uses this module.
"""

from __future__ import annotations

from typing import Literal, get_args

ObjectSource = Literal["V", "L", "VL"]
"""Vision only, LiDAR only, or both (paper, Table 3 "Name")."""

OBJECT_SOURCES: tuple[ObjectSource, ...] = get_args(ObjectSource)
MOST_SENSORS_FIRST: tuple[ObjectSource, ...] = tuple(sorted(OBJECT_SOURCES, key=len, reverse=True))
"""Order of the sources in tables."""

SENSOR_NAMES = {"V": "camera", "L": "LiDAR"}
"""Display name of the sensor for each letter."""


def is_camera_in(sensors: str) -> bool:
    """Whether the camera is among them."""
    return "V" in sensors


def is_ranging_in(sensors: str) -> bool:
    """Whether a sensor that measures range is among them; currently only the LiDAR does."""
    return "L" in sensors


def is_lidar_in(sensors: str) -> bool:
    """Whether the LiDAR is among them."""
    return "L" in sensors


def are_several(sensors: str) -> bool:
    """Whether there is more than one sensor."""
    return len(sensors) > 1


def sensors_in_words(source: str) -> str:
    """``camera only``, ``LiDAR only``, ``both sensors``."""
    if are_several(source):
        return "both sensors" if len(source) == 2 else ", ".join(_names(source))
    return ", ".join(f"{name} only" for name in _names(source))


def seeing_sensors_in_words(sensors: str) -> str:
    """The sensors that see an object, to end a sentence with: ``the camera``, ``the LiDAR``, ``both sensors``, ``no
    sensor``."""
    if are_several(sensors):
        return sensors_in_words(sensors)
    return "".join(f"the {name}" for name in _names(sensors)) or "no sensor"


def _names(sensors: str) -> list[str]:
    return [SENSOR_NAMES[letter] for letter in sensors]
