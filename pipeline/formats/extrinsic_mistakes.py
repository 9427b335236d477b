"""Finds the likely mistake in a calibration whose camera does not look ahead: each common mistake is undone, and the
one that makes the camera look ahead and upright is reported."""

from __future__ import annotations

import numpy as np

from pipeline.common.geometry import T_OPTICAL_BODY, inverse, rotation
from pipeline.types import F64

_UPRIGHT = 0.5
"""Cosine of the largest roll of an upright camera: 60°."""


def _turned(yaw_deg: float) -> F64:
    T = np.eye(4)
    T[:3, :3] = rotation(0.0, 0.0, np.radians(yaw_deg))
    return T


_MISTAKES = (
    ("is its extrinsic inverted? It must take LiDAR points to the camera", inverse),
    (
        "its extrinsic is in the camera's body axes (x forward); it must be in the optical ones (z forward, y down)",
        lambda T: T_OPTICAL_BODY @ T,
    ),
    (
        "is its extrinsic inverted? It must take LiDAR points to the camera, to optical axes (z forward, y down)",
        lambda T: T_OPTICAL_BODY @ inverse(T),
    ),
    ("the LiDAR's axes are swapped: x must point forward and y to the left", lambda T: T @ _turned(90.0)),
    ("the LiDAR's axes are swapped: x must point forward and y to the left", lambda T: T @ _turned(-90.0)),
    ("the LiDAR's x axis points backwards: it must point forward", lambda T: T @ _turned(180.0)),
)
_UNKNOWN = "is its extrinsic inverted?"


def looks_ahead(K: F64, T_camera_ego: F64, size: tuple[int, int]) -> bool:
    """Whether ego +x falls inside the image of (width, height) widened by half its size on every side."""
    forward = T_camera_ego[:3, 0]
    if forward[2] <= 1e-3:
        return False
    u, v = (K @ (forward / forward[2]))[:2]
    return bool(-0.5 <= u / size[0] <= 1.5 and -0.5 <= v / size[1] <= 1.5)


def is_upright(T_camera_ego: F64) -> bool:
    """Whether ego +z is up in the image."""
    return bool(T_camera_ego[1, 2] < -_UPRIGHT)


def likely_mistake(K: F64, T_camera_lidar: F64, T_lidar_ego: F64, size: tuple[int, int]) -> str:
    """The likely cause of an extrinsic that does not look ahead, as the end of a sentence. T_lidar_ego: (4, 4), the
    identity where the extrinsic is from the ego frame."""
    for text, undo in _MISTAKES:
        undone = undo(T_camera_lidar) @ T_lidar_ego
        if looks_ahead(K, undone, size) and is_upright(undone):
            return text
    return _UNKNOWN
