"""OpenCV's YAML (``cv::FileStorage``): camera_matrix, distortion_coefficients, image_width, image_height as its
calibration sample writes them, and T_camera_lidar (4, 4).

Read without OpenCV, whose own parser writes beyond its memory on a damaged file (5.0.0, ``free(): invalid next size``).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pipeline.common.files.user_file_errors import parse_yaml
from pipeline.formats.calibration_files.contents import CalibrationFiles, the_file
from pipeline.formats.file_reading import camera_matrix, check_looks_ahead, rigid_transform
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

_LENGTHS = (0, 4, 5, 8)
_TAG = "!!opencv-matrix"
_VERSION = "%YAML:1.0"
"""First line of OpenCV's files, which is not a valid YAML directive."""
_MOST_NUMBERS = 1000


def parse(files: CalibrationFiles, size: tuple[int, int] | None, T_ego_lidar: F64 | None = None) -> CameraCalibration:
    name, data = the_file(files)
    text = data.decode("utf-8", "replace").strip().removeprefix(_VERSION)
    loaded = parse_yaml(text.replace(_TAG, ""), name, SourceError)
    if not isinstance(loaded, dict):
        raise SourceError(f"{name}: not an OpenCV FileStorage file")
    K = camera_matrix(_matrix(loaded, "camera_matrix", name), f"{name}: camera_matrix")
    T = rigid_transform(_matrix(loaded, "T_camera_lidar", name), f"{name}: T_camera_lidar")
    lens = "distortion_coefficients"
    distortion = _matrix(loaded, lens, name).ravel() if loaded.get(lens) is not None else np.zeros(0)
    if len(distortion) not in _LENGTHS or not np.all(np.isfinite(distortion)):
        raise SourceError(f"{name}: {len(distortion)} distortion coefficients; 4, 5 or 8 are supported")
    width, height = (_pixels(loaded.get(f"image_{side}")) for side in ("width", "height"))
    if (width, height) == (0, 0) and size is not None:
        width, height = size
    if min(width, height) < 16:
        raise SourceError(f"{name}: no image_width and image_height")
    camera = CameraCalibration(K, distortion if np.any(distortion) else np.zeros(0), T, width, height)
    check_looks_ahead(camera, name, T_ego_lidar)
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


def _matrix(loaded: dict[Any, Any], name: str, file: str) -> F64:
    """As OpenCV writes one: ``rows``, ``cols`` and ``data``."""
    node = loaded.get(name)
    if node is None:
        raise SourceError(f"{file}: no {name}")
    try:
        rows, columns = int(node["rows"]), int(node["cols"])
        if min(rows, columns) < 1 or rows * columns > _MOST_NUMBERS:
            raise ValueError
        return np.asarray(node["data"], dtype=np.float64).reshape(rows, columns)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise SourceError(f"{file}: {name} is not a matrix of OpenCV") from None


def _pixels(value: Any) -> int:
    """0 for anything but a number of pixels."""
    return value if isinstance(value, int) else 0
