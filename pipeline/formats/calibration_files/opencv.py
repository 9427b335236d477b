"""OpenCV's YAML (``cv::FileStorage``): camera_matrix, distortion_coefficients, image_width, image_height as its
calibration sample writes them, and T_camera_lidar (4, 4)."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from pipeline.formats.file_reading import camera_matrix, check_looks_ahead, read_bytes, rigid_transform
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

_LENGTHS = (0, 4, 5, 8)


def read(path: Path, size: tuple[int, int] | None) -> CameraCalibration:
    text = read_bytes(path).decode("utf-8", "replace")
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    except cv2.error:
        raise SourceError(f"{path.name}: not an OpenCV FileStorage file") from None
    try:
        K = camera_matrix(_matrix(storage, "camera_matrix", path), f"{path.name}: camera_matrix")
        T = rigid_transform(_matrix(storage, "T_camera_lidar", path), f"{path.name}: T_camera_lidar")
        node = storage.getNode("distortion_coefficients")
        distortion = np.zeros(0) if node.empty() else np.asarray(node.mat(), dtype=np.float64).ravel()
        width, height = (int(storage.getNode(f"image_{side}").real()) for side in ("width", "height"))
    finally:
        storage.release()
    if len(distortion) not in _LENGTHS or not np.all(np.isfinite(distortion)):
        raise SourceError(f"{path.name}: {len(distortion)} distortion coefficients; 4, 5 or 8 are supported")
    if (width, height) == (0, 0) and size is not None:
        width, height = size
    if min(width, height) < 16:
        raise SourceError(f"{path.name}: no image_width and image_height")
    camera = CameraCalibration(K, distortion if np.any(distortion) else np.zeros(0), T, width, height)
    check_looks_ahead(camera, path.name)
    return camera


def write(path: Path, camera: CameraCalibration) -> None:
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("image_width", camera.width)
    storage.write("image_height", camera.height)
    storage.write("camera_matrix", camera.K)
    storage.write(
        "distortion_coefficients", np.atleast_2d(camera.distortion if camera.distortion.size else np.zeros(5))
    )
    storage.write("T_camera_lidar", camera.T_camera_ego)
    path.write_text(storage.releaseAndGetString(), encoding="utf-8")


def _matrix(storage: cv2.FileStorage, name: str, path: Path) -> F64:
    node = storage.getNode(name)
    if node.empty() or node.mat() is None:
        raise SourceError(f"{path.name}: no {name}")
    return np.asarray(node.mat(), dtype=np.float64)
