"""What is known of a camera's images before the first: where the horizon is, and their aspect."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.common.geometry import F64
from pipeline.types import CameraCalibration

_UNCALIBRATED = 0.57
"""Row of the horizon as a share of the image's height, for an uncalibrated dashboard camera."""
_USUAL_ASPECT = 9 / 16


class ImageOutline(NamedTuple):
    """Of the images of a camera."""

    horizon: float
    """Row of the horizon, as a share of their height."""
    aspect: float
    """Their height divided by their width."""


def horizon_row(camera: CameraCalibration) -> float:
    """The row in which ego +x vanishes, pixels; lens distortion is small there and neglected."""
    forward: F64 = camera.T_camera_ego[:3, :3] @ np.array([1.0, 0.0, 0.0])
    return float(camera.K[1, 1] * forward[1] / forward[2] + camera.K[1, 2])


def horizon_share(camera: CameraCalibration | None) -> float:
    """The same as a share of the image's height; for an unknown camera, that of a dashboard camera."""
    return horizon_row(camera) / camera.height if camera is not None else _UNCALIBRATED


def image_outline(camera: CameraCalibration | None) -> ImageOutline:
    """Of a camera's images; of an unknown one, that of a dashboard camera."""
    aspect = camera.height / camera.width if camera is not None else _USUAL_ASPECT
    return ImageOutline(horizon_share(camera), aspect)
