"""Names for arrays, points and boxes, and for the sensors that have an object."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U8 = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]
Point2 = tuple[float, float]
Point3 = tuple[float, float, float]
Box = tuple[float, float, float, float]
"""Axis-aligned image box ``x1 y1 x2 y2`` in pixels."""
Window = tuple[int, int, int, int]
"""A part of a picture, ``x1 y1 x2 y2`` in whole pixels, the last ones not in it."""
SourceKind = Literal["V", "L", "VL"]
"""Which sensors have an object: vision only, LiDAR only, or both (paper, Table 3 "Name"). One letter a sensor."""

SENSOR_NAMES = {"V": "camera", "L": "LiDAR"}
"""What people call the sensor of each letter."""


def sensors_in_words(source: str) -> str:
    """``camera only``, ``LiDAR only``, ``both sensors``."""
    if len(source) == 2:
        return "both sensors"
    names = [SENSOR_NAMES[letter] for letter in source]
    return f"{names[0]} only" if len(names) == 1 else ", ".join(names)


VEHICLES = frozenset({"car", "truck", "bus", "motorcycle"})
"""Class names that may be a lead vehicle. Detector labels are mapped to the COCO names by the detector."""
