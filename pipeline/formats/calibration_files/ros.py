"""ROS: a folder with ``camera_info.yaml``, as ``camera_calibration`` writes it, and ``static_transform.yaml``, a
``geometry_msgs/TransformStamped``. Its frames give the direction of the transform: the camera's frame is that in the
header of the camera info, optical (REP 103)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from pipeline.common.geometry import inverse, rotation
from pipeline.formats.calibration_files.contents import CalibrationFiles, yaml_mapping
from pipeline.formats.file_reading import camera_matrix, check_looks_ahead, rigid_transform
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

INFO, TRANSFORM = "camera_info.yaml", "static_transform.yaml"
_CAMERA, _LIDAR = "camera_optical", "lidar"
_MODELS = {"plumb_bob": (4, 5), "rational_polynomial": (8,)}
_ANGLES = ("roll", "pitch", "yaw")


def parse(files: CalibrationFiles, size: tuple[int, int] | None, T_ego_lidar: F64 | None = None) -> CameraCalibration:
    info, transform = (yaml_mapping(files, name) for name in (INFO, TRANSFORM))
    try:
        K = camera_matrix(np.reshape(info["camera_matrix"]["data"], (3, 3)), f"{INFO}: camera_matrix")
        distortion = np.asarray(info.get("distortion_coefficients", {}).get("data", []), dtype=np.float64)
        model = str(info.get("distortion_model", "plumb_bob"))
        width, height = int(info["image_width"]), int(info["image_height"])
        own = str(info.get("header", {}).get("frame_id", _CAMERA)).lstrip("/")
        parent = str(transform["header"]["frame_id"]).lstrip("/")
        child = str(transform["child_frame_id"]).lstrip("/")
        T_parent_child = _transform(transform["transform"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise SourceError(f"{INFO}, {TRANSFORM}: incomplete camera info or transform: {error}") from None
    if distortion.ndim != 1 or not np.all(np.isfinite(distortion)):
        raise SourceError(f"{INFO}: distortion_coefficients.data: not a list of finite numbers")
    if np.any(distortion) and len(distortion) not in _MODELS.get(model, ()):
        raise SourceError(f"{INFO}: {model} with {len(distortion)} numbers is not supported")
    if own not in (parent, child):
        raise SourceError(f"{TRANSFORM}: goes from {child} to {parent}, but the camera's frame is {own}")
    T_camera_lidar = T_parent_child if own == parent else inverse(T_parent_child)
    lens = distortion if np.any(distortion) else np.zeros(0)
    camera = CameraCalibration(K, lens, T_camera_lidar, width, height)
    check_looks_ahead(camera, TRANSFORM, T_ego_lidar)
    return camera


def write(path: Path, camera: CameraCalibration) -> None:
    path.mkdir(parents=True, exist_ok=True)
    lens = camera.distortion if camera.distortion.size else np.zeros(5)
    info = {
        "header": {"frame_id": _CAMERA},
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": "front",
        "camera_matrix": _rows(camera.K),
        "distortion_model": "rational_polynomial" if len(lens) == 8 else "plumb_bob",
        "distortion_coefficients": _rows(lens[None]),
        "rectification_matrix": _rows(np.eye(3)),
        "projection_matrix": _rows(np.hstack([camera.K, np.zeros((3, 1))])),
    }
    x, y, z, w = _quaternion(camera.T_camera_ego[:3, :3])
    place = dict(zip("xyz", camera.T_camera_ego[:3, 3].tolist(), strict=True))
    transform = {
        "header": {"frame_id": _CAMERA},
        "child_frame_id": _LIDAR,
        "transform": {"translation": place, "rotation": {"x": x, "y": y, "z": z, "w": w}},
    }
    for name, content in ((INFO, info), (TRANSFORM, transform)):
        (path / name).write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def _transform(given: dict[str, Any]) -> F64:
    """(4, 4) of a translation in metres and a rotation as a quaternion, or as roll, pitch and yaw in radians."""
    T, turn = np.eye(4), given["rotation"]
    if "w" in turn:
        x, y, z, w = (float(turn[name]) for name in "xyzw")
        if not np.isclose(x * x + y * y + z * z + w * w, 1.0, atol=1e-3):
            raise SourceError(f"{TRANSFORM}: the quaternion is not of unit length")
        T[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    else:
        angles = [float(turn[name]) for name in _ANGLES]
        if max(map(abs, angles)) > 2 * np.pi:
            raise SourceError(f"{TRANSFORM}: roll, pitch and yaw are in radians; these look like degrees")
        T[:3, :3] = rotation(*angles)
    T[:3, 3] = [float(given["translation"][axis]) for axis in "xyz"]
    return rigid_transform(T, TRANSFORM)


def _quaternion(R: F64) -> tuple[float, float, float, float]:
    """x y z w of a rotation: the eigenvector of the largest eigenvalue (Bar-Itzhack 2000), sound for every angle."""
    Q = np.zeros((4, 4))
    Q[:3, :3] = R + R.T - np.trace(R) * np.eye(3)
    Q[:3, 3] = Q[3, :3] = [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    Q[3, 3] = np.trace(R)
    _, vectors = np.linalg.eigh(Q)
    x, y, z, w = (vectors[:, -1] * (1.0 if vectors[3, -1] >= 0 else -1.0)).tolist()
    return x, y, z, w


def _rows(values: F64) -> dict[str, Any]:
    return {"rows": values.shape[0], "cols": values.shape[1], "data": values.ravel().tolist()}
