"""What the car that was put into the street does, and how the pipeline saw it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from pipeline.common.files.data_dir import data_dir
from pipeline.common.geometry import F64
from pipeline.detection import Detectors
from pipeline.lanes.open_detector import usual_every
from pipeline.params import Params
from pipeline.run import Sensors, through
from pipeline.types import Frame, Result
from tests import looking
from tests.accuracy.inserted_cars.cut_outs import cut_out
from tests.accuracy.inserted_cars.street import URI, Street, street

_NEAREST_M = 4.0
"""Nearer than this the car is not drawn: ours would have hit it."""
IN_PATH_M = 1.2
"""A car whose middle is no farther aside is in the path."""


class Course(NamedTuple):
    """By frame: distance of its near face along our way, and aside of it (positive to the left)."""

    gap_m: F64
    aside_m: F64


def _constant(gap_m: float) -> Callable[[Street], Course]:
    return lambda on: Course(np.full(len(on.frames), gap_m), np.zeros(len(on.frames)))


def _stands(first_m: float, share: float = 1.0, aside_m: float = 0.0) -> Callable[[Street], Course]:
    """Approached with this share of our speed."""
    return lambda on: Course(first_m - share * on.travelled_m, np.full(len(on.frames), aside_m))


def _brakes(on: Street) -> Course:
    """22 m ahead at our speed, it brakes with 4 m/s² after a second."""
    speed = float(np.median(on.speed_mps))
    braking_s = np.clip(on.time_s - 1.0, 0.0, speed / 4.0)
    standing_s = np.maximum(on.time_s - 1.0 - speed / 4.0, 0.0)
    return Course(22.0 - 2.0 * braking_s**2 - speed * standing_s, np.zeros(len(on.frames)))


def _moves(from_m: float, to_m: float, begin_s: float) -> Callable[[Street], Course]:
    """22 m ahead at our speed, it changes its lane within two seconds."""

    def course(on: Street) -> Course:
        share = np.clip((on.time_s - begin_s) / 2.0, 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        return Course(np.full(len(on.frames), 22.0), from_m + share * (to_m - from_m))

    return course


MANOEUVRES: dict[str, Callable[[Street], Course]] = {
    "follows at 20 m": _constant(20.0),
    "follows at 35 m": _constant(35.0),
    "follows at 50 m": _constant(50.0),
    "stands 60 m ahead": _stands(60.0),
    "drives at half our speed": _stands(60.0, share=0.5),
    "brakes in front of us": _brakes,
    "pulls out of the parked row": _moves(-2.6, 0.0, 1.5),
    "leaves to the left": _moves(0.0, 3.0, 2.0),
    "comes towards us": _stands(100.0, share=2.0, aside_m=2.7),
}


class Seen(NamedTuple):
    """One frame of a manoeuvre."""

    distance_m: float
    """To the middle of the car's near face; NaN while it is not in the street."""
    in_path: bool
    result: Result


@cache
def _with_car(manoeuvre: str, car: str) -> tuple[list[Frame], list[float], Course]:
    on, rng = street(), np.random.default_rng(1)
    course, seen = MANOEUVRES[manoeuvre](on), cut_out(car)
    frames, distances = [], []
    for index, frame in enumerate(on.frames):
        gap_m, near = float(course.gap_m[index]), np.full(2, np.nan)
        if gap_m > _NEAREST_M:
            frame, near = on.with_car(index, seen, gap_m, float(course.aside_m[index]), rng)
        frames.append(frame)
        distances.append(float(np.hypot(*near)))
    return frames, distances, course


def seen(manoeuvre: str, car: str, sensors: Sensors = "both") -> list[Seen]:
    """What the pipeline made of it, with YOLOX-nano, TwinLiteNet and their far views."""
    frames, distances, course = _with_car(manoeuvre, car)
    image = frames[0].image
    assert image is not None
    height, width = image.bgr.shape[:2]
    lanes = looking.lanes(URI, "twinlitenet")
    assert lanes is not None
    detectors = Detectors(
        looking.yolox_nano(data_dir(), width, height),
        lanes,
        usual_every(lanes.detector, 10.0),
        looking.far_view(data_dir(), width, height),
        far_lanes=looking.far_lanes(URI, "twinlitenet"),
    )
    beside = np.abs(course.aside_m) >= IN_PATH_M
    return [
        Seen(distance_m, bool(np.isfinite(distance_m) and not out), result)
        for distance_m, out, (_, result) in zip(
            distances, beside.tolist(), through(frames, Params(), detectors, sensors), strict=True
        )
    ]
