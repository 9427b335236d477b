"""The image of a camera that is turned in its mount, resampled from one with a margin that the calibrated camera sees.

Turning a camera about its own centre moves every pixel in a way that no distance enters, so the scene need not be drawn
again.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from pipeline.simulation.drawing.lens import distorted, undistorted
from pipeline.types import F32, F64, U8, CameraCalibration


def with_margin(camera: CameraCalibration, margin_px: int) -> CameraCalibration:
    """The same camera with this many more pixels on every side of its image."""
    if not margin_px:
        return camera
    K = camera.K.copy()
    K[:2, 2] += margin_px
    width, height = camera.width + 2 * margin_px, camera.height + 2 * margin_px
    return CameraCalibration(K, camera.distortion, camera.T_camera_ego, width, height, camera.road_z_m)


def margin_for(camera: CameraCalibration, turn_rad: float) -> int:
    """The margin from which the image of a camera turned by at most this angle, about any axis, can be resampled."""
    if not turn_rad:
        return 0
    shift = np.tan(turn_rad) * float(camera.K[0, 0]) * 1.5  # off the axis, a pixel is less than 1 / focal radian
    rolled = np.sin(turn_rad) * camera.width / 2
    return int(np.ceil(max(shift, rolled)))


def turned(image: U8, camera: CameraCalibration, margin_px: int, actual: CameraCalibration) -> U8:
    """(H, W, 3) what ``actual`` sees, which is ``camera`` turned about its centre. image: what
    ``with_margin(camera, margin_px)`` sees."""
    rotation = camera.T_camera_ego[:3, :3] @ actual.T_camera_ego[:3, :3].T
    columns, rows = _maps(
        camera.K.tobytes(), camera.distortion.tobytes(), camera.width, camera.height, margin_px, rotation.tobytes()
    )
    return np.asarray(cv2.remap(image, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)


@lru_cache(maxsize=2)
def _maps(K: bytes, distortion: bytes, width: int, height: int, margin_px: int, rotation: bytes) -> tuple[F32, F32]:
    """(H, W) columns and rows of the image with a margin, for every pixel of the turned camera. Kept, since
    a mount hardly ever turns from frame to frame, and they take four times as long as the rest of an image."""
    turn, matrix = np.frombuffer(rotation).reshape(3, 3), np.frombuffer(K).reshape(3, 3)
    rays = _rays(K, distortion, width, height) @ turn.T.astype(np.float32)
    flat = rays[:, :2] / np.maximum(rays[:, 2:], np.float32(1e-3))
    bent = distorted(flat, np.frombuffer(distortion))
    columns, rows = (
        (bent[:, axis] * matrix[axis, axis] + matrix[axis, 2] + margin_px).astype(np.float32).reshape(height, width)
        for axis in (0, 1)
    )
    return columns, rows


@lru_cache(maxsize=2)
def _rays(K: bytes, distortion: bytes, width: int, height: int) -> F32:
    """(H·W, 3) viewing directions of all pixels, camera axes, z = 1."""
    matrix: F64 = np.frombuffer(K).reshape(3, 3)
    v, u = np.mgrid[:height, :width]
    seen = np.column_stack([(u.ravel() - matrix[0, 2]) / matrix[0, 0], (v.ravel() - matrix[1, 2]) / matrix[1, 1]])
    ideal = undistorted(seen, np.frombuffer(distortion))
    return np.column_stack([ideal, np.ones(len(ideal))]).astype(np.float32)
