"""Calibrations for lane networks, which differ in where the road vanishes."""

from __future__ import annotations

import numpy as np

from pipeline.types import CameraCalibration

_LEVEL = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def camera_of(focal_px: float, width: int, height: int, vanishes_at: tuple[float, float]) -> CameraCalibration:
    """A camera without distortion in whose image ego +x vanishes at this pixel u, v."""
    K = np.array([[focal_px, 0.0, vanishes_at[0]], [0.0, focal_px, vanishes_at[1]], [0.0, 0.0, 1.0]])
    return CameraCalibration(K, np.zeros(0), _LEVEL, width, height)
