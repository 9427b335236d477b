"""ROS: a folder with ``camera_info.yaml``, as ``camera_calibration`` writes it, and ``static_transform.yaml``, a
``geometry_msgs/TransformStamped``. Its frames give the direction of the transform: the camera's frame is that in the
header of the camera info, optical (REP 103). Also what ``ros2 topic echo`` prints of a CameraInfo and of a TFMessage
with one transform."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from pipeline.common.files.output_files import write_new_files
from pipeline.common.geometry import inverse, rotation
from pipeline.formats.calibration_files.contents import CalibrationFiles, file_of, the_file, yaml_mapping
from pipeline.formats.calibration_files.lens import polynomial_lens
from pipeline.formats.file_reading import camera_matrix, check_looks_ahead, rigid_transform
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

INFO, TRANSFORM = "camera_info.yaml", "static_transform.yaml"
_CAMERA, _LIDAR = "camera_optical", "lidar"
_ANGLES = ("roll", "pitch", "yaw")


def parse(files: CalibrationFiles, size: tuple[int, int] | None, T_ego_lidar: F64 | None = None) -> CameraCalibration:
    if INFO not in files and TRANSFORM not in files:
        raise SourceError(f"{the_file(files).name}: ROS needs two files: a folder with {INFO} and {TRANSFORM}")
    info_file, transform_file = file_of(files, INFO), file_of(files, TRANSFORM)
    in_info, in_transform = info_file.name, transform_file.name
    info = _as_saved(yaml_mapping(info_file))
    transform = _the_transform(yaml_mapping(transform_file), in_transform)
    try:
        K = camera_matrix(np.reshape(info["camera_matrix"]["data"], (3, 3)), f"{in_info}: camera_matrix")
        distortion = info.get("distortion_coefficients", {}).get("data", [])
        model = str(info.get("distortion_model", "plumb_bob"))
        width, height = int(info["image_width"]), int(info["image_height"])
        parent = str(transform["header"]["frame_id"]).lstrip("/")
        child = str(transform["child_frame_id"]).lstrip("/")
        own = _camera_frame(info, parent, child, in_info)
        T_parent_child = _transform(transform["transform"], in_transform)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise SourceError(f"{in_info}, {in_transform}: incomplete camera info or transform: {error}") from None
    if min(width, height) < 16:
        raise SourceError(f"{in_info}: invalid image_width or image_height")
    lens = polynomial_lens(distortion, model, f"{in_info}: distortion")
    if own not in (parent, child):
        raise SourceError(f"{in_transform}: goes from {child} to {parent}, but the camera's frame is {own}")
    T_camera_lidar = T_parent_child if own == parent else inverse(T_parent_child)
    camera = CameraCalibration(K, lens, T_camera_lidar, width, height)
    check_looks_ahead(camera, in_transform, T_ego_lidar)
    return camera


def write(path: Path, camera: CameraCalibration) -> None:
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
    files = {INFO: info, TRANSFORM: transform}
    write_new_files(path, {name: yaml.safe_dump(content, sort_keys=False) for name, content in files.items()})


def _as_saved(info: dict[str, Any]) -> dict[str, Any]:
    """A message with the names of a saved file; ROS 1 has capital letters for K and D."""
    if "camera_matrix" in info or "width" not in info:
        return info
    K, D = (info.get(name.upper(), info.get(name)) for name in "kd")
    size = {"image_width": info["width"], "image_height": info.get("height")}
    return {**info, **size, "camera_matrix": {"data": K}, "distortion_coefficients": {"data": D}}


def _the_transform(given: dict[str, Any], file: str) -> dict[str, Any]:
    """The one transform of a TFMessage."""
    several = given.get("transforms", [given])
    if not isinstance(several, list) or len(several) != 1 or not isinstance(several[0], dict):
        raise SourceError(f"{file}: has several transforms or none; give the one between camera and LiDAR")
    return several[0]


def _camera_frame(info: dict[str, Any], parent: str, child: str, file: str) -> str:
    """The frame of the header. Files of ``camera_calibration`` have none: then that of the two with "cam" or "optical"
    or with the camera's name in it."""
    header = info.get("header") or {}
    if header.get("frame_id"):
        return str(header["frame_id"]).lstrip("/")
    for words in (("cam", "optical"), (str(info.get("camera_name") or "cam").lower(),)):
        found = [frame for frame in (parent, child) if any(word in frame.lower() for word in words)]
        if len(found) == 1:
            return found[0]
    raise SourceError(f"{file}: no header with the camera's frame_id; add it: {parent} or {child}")


def _transform(given: dict[str, Any], file: str) -> F64:
    """(4, 4) of a translation in metres and a rotation as a quaternion, or as roll, pitch and yaw in radians."""
    T, turn = np.eye(4), given["rotation"]
    if "w" in turn:
        x, y, z, w = (float(turn[name]) for name in "xyzw")
        if not np.isclose(x * x + y * y + z * z + w * w, 1.0, atol=1e-3):
            raise SourceError(f"{file}: the quaternion is not of unit length")
        T[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    else:
        angles = [float(turn[name]) for name in _ANGLES]
        if max(map(abs, angles)) > 2 * np.pi:
            raise SourceError(f"{file}: roll, pitch and yaw are in radians; these look like degrees")
        T[:3, :3] = rotation(*angles)
    T[:3, 3] = [float(given["translation"][axis]) for axis in "xyz"]
    return rigid_transform(T, file)


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
