"""Names for arrays, points and boxes."""

from __future__ import annotations

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
PixelWindow = tuple[int, int, int, int]
"""Pixel region of an image, ``x1 y1 x2 y2``; x2 and y2 are exclusive."""
VEHICLES = frozenset({"car", "truck", "bus", "motorcycle"})
"""Class names that may be a lead vehicle. Detector labels are mapped to the COCO names by the detector."""
