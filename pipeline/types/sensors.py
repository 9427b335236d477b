"""Every kind of sensor that sees objects, declared once, and the letters by which results name them.

The stages of the camera and of the LiDAR are written out in ``pipeline.step``. Any other sensor that measures range,
such as a radar, is a module with a tracker, and one entry in ``SENSOR_KINDS``: sessions, fusion, evidence, results,
scores and the page follow. See *A radar* in docs/architecture.md. This module does not import the modules it names.

Stages ask an object for its capabilities (``FusedObject.ranged``); only code that reads stored rows asks the functions
below about letters.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any


@dataclass(frozen=True)
class SensorKind:
    """One kind of sensor."""

    letter: str
    """Its letter in an object's ``source`` and ``seen_by``."""
    name: str
    """Its key in ``Frame.scans`` and in a result's ``sensors``; ``/<name>/points`` is its topic in a session."""
    title: str
    """What people call it, within a sentence."""
    is_camera: bool = False
    """Whether it gives class and image box."""
    is_ranging: bool = False
    """Whether it measures range."""
    tracker: str = ""
    """``module:function`` that tracks the detections of its scans (``pipeline.ranging.further.Tracker``); empty for
    camera and LiDAR."""
    simulator: str = ""
    """``module:function`` that computes its scan of a simulated world (``pipeline.simulation.sensors.rig.Simulator``);
    empty if the simulator does not have it."""
    sighting_odds: float = 0.0
    """Log-odds of existence that one sighting of its track adds, for a sensor with a ``tracker``."""

    def track(self, *args: Any) -> Any:
        """Calls ``tracker``."""
        return _imported(self.tracker)(*args)

    def simulate(self, *args: Any) -> Any:
        """Calls ``simulator``."""
        return _imported(self.simulator)(*args)


CAMERA = SensorKind("V", "camera", "camera", is_camera=True)
LIDAR = SensorKind("L", "lidar", "LiDAR", is_ranging=True)
SENSOR_KINDS: tuple[SensorKind, ...] = (CAMERA, LIDAR)
"""In the order of their letters. Append new kinds: stored timelines number sources by this order."""

ObjectSource = str
"""The letters of one or more sensors, in the order of ``SENSOR_KINDS``: ``V`` camera only, ``L`` LiDAR only, ``VL``
both (paper, Table 3 "Name"). In ``FusedObject.seen_by`` also none."""


@cache  # asked for every object
def further_sensors() -> tuple[SensorKind, ...]:
    """The kinds besides camera and LiDAR."""
    return tuple(kind for kind in SENSOR_KINDS if kind.tracker)


def joined(*sources: str) -> ObjectSource:
    """The letters of several sources together, each once, in order."""
    return "".join([kind.letter for kind in SENSOR_KINDS if any(kind.letter in each for each in sources)])


def object_sources() -> tuple[ObjectSource, ...]:
    """Every possible source; its place, from 1, is its number in stored timelines: the sum of 1 for the first kind, 2
    for the second, 4 for the third and so on."""
    sources: list[ObjectSource] = []
    for kind in SENSOR_KINDS:
        sources += [each + kind.letter for each in ("", *sources)]
    return tuple(sources)


def most_sensors_first() -> tuple[ObjectSource, ...]:
    """Every possible source in the order of tables."""
    return tuple(sorted(object_sources(), key=len, reverse=True))


def is_camera_in(sensors: str) -> bool:
    """Whether the camera is among them."""
    return CAMERA.letter in sensors


@cache  # asked hundreds of times a frame
def is_ranging_in(sensors: str) -> bool:
    """Whether a sensor that measures range is among them."""
    return any([kind.is_ranging and kind.letter in sensors for kind in SENSOR_KINDS])


def is_lidar_in(sensors: str) -> bool:
    """Whether the LiDAR is among them."""
    return LIDAR.letter in sensors


def are_several(sensors: str) -> bool:
    """Whether there is more than one sensor."""
    return len(sensors) > 1


def kinds_in(sensors: str) -> list[SensorKind]:
    """The kinds of the sensors among them."""
    return [kind for kind in SENSOR_KINDS if kind.letter in sensors]


def sensors_in_words(source: str) -> str:
    """``camera only``, ``LiDAR only``, ``both sensors``; with further sensors, ``camera and radar``."""
    if not are_several(source):
        return f"{_titles(source)} only" if source else ""
    return "both sensors" if source == CAMERA.letter + LIDAR.letter else _titles(source)


def seeing_sensors_in_words(sensors: str) -> str:
    """The sensors that see an object, to end a sentence with: ``the camera``, ``the LiDAR``, ``both sensors``, ``no
    sensor``."""
    if are_several(sensors):
        return sensors_in_words(sensors)
    return f"the {_titles(sensors)}" if sensors else "no sensor"


def _titles(sensors: str) -> str:
    *first, last = [kind.title for kind in kinds_in(sensors)]
    return f"{', '.join(first)} and {last}" if first else last


def _imported(target: str) -> Any:
    module, function = target.split(":")
    return getattr(import_module(module), function)
