"""OpenCV's YAML (``cv::FileStorage``): camera_matrix, distortion_coefficients, image_width, image_height as its
calibration sample writes them, and T_camera_lidar (4, 4).

Read without OpenCV, whose own parser writes beyond its memory on a damaged file (5.0.0, ``free(): invalid next size``).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pipeline.common.files.output_files import write_new
from pipeline.common.files.user_file_errors import parse_yaml
from pipeline.common.geometry import inverse
from pipeline.formats.calibration_files.contents import CalibrationFiles, plain_yaml, the_file
from pipeline.formats.calibration_files.lens import FISHEYE, polynomial_lens
from pipeline.formats.file_reading import camera_matrix, check_looks_ahead, rigid_transform
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

_K = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMat", "K")
_LENS = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "DistCoeff", "D")
_FORWARD, _BACKWARD = ("T_camera_lidar", "T_cam_lidar"), ("T_lidar_camera", "T_lidar_cam", "CameraExtrinsicMat")
"""The first is that written here; others are of OpenCV's own samples and of Autoware.AI, whose extrinsic is the
camera's pose in the LiDAR's frame."""
_WIDTH, _HEIGHT = ("image_width", "image_Width"), ("image_height", "image_Height")
_TAG = "!!opencv-matrix"
_MOST_NUMBERS = 1000


def parse(files: CalibrationFiles, size: tuple[int, int] | None, T_ego_lidar: F64 | None = None) -> CameraCalibration:
    name, data = the_file(files)
    text = plain_yaml(data.decode("utf-8", "replace"))
    loaded = parse_yaml(text.replace(_TAG, ""), name, SourceError)
    if not isinstance(loaded, dict):
        raise SourceError(f"{name}: not an OpenCV FileStorage file")
    K_name, lens_name, T_name = (_called(loaded, names) for names in (_K, _LENS, (*_FORWARD, *_BACKWARD)))
    K = camera_matrix(_matrix(loaded, K_name, name), f"{name}: {K_name}")
    T = rigid_transform(_matrix(loaded, T_name, name), f"{name}: {T_name}")
    coefficients = _matrix(loaded, lens_name, name).ravel() if loaded.get(lens_name) is not None else np.zeros(0)
    model = FISHEYE if loaded.get("fisheye_model") else str(loaded.get("DistModel", ""))
    lens = polynomial_lens(coefficients, model, f"{name}: {lens_name}")
    width, height = _size(loaded)
    if (width, height) == (0, 0) and size is not None:
        width, height = size
    if min(width, height) < 16:
        raise SourceError(f"{name}: no image_width and image_height")
    camera = CameraCalibration(K, lens, T if T_name in _FORWARD else inverse(T), width, height)
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
    write_new(path, storage.releaseAndGetString())


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


def _called(loaded: dict[Any, Any], names: tuple[str, ...]) -> str:
    """The first of the names that the file has; the first of all if it has none."""
    return next((name for name in names if loaded.get(name) is not None), names[0])


def _size(loaded: dict[Any, Any]) -> tuple[int, int]:
    """Width and height; 0 for what the file does not say."""
    both = loaded.get("ImageSize")
    if isinstance(both, list) and len(both) == 2:
        return _pixels(both[0]), _pixels(both[1])
    width, height = (_pixels(loaded.get(_called(loaded, names))) for names in (_WIDTH, _HEIGHT))
    return width, height


def _pixels(value: Any) -> int:
    """0 for anything but a number of pixels."""
    return value if isinstance(value, int) else 0
