"""The mounts of a bag's sensors: ``tf_static`` and ``CameraInfo`` (REP 103, REP 105)."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from pipeline.common.geometry import T_OPTICAL_BODY, inverse
from pipeline.formats.calibration_files.lens import polynomial_lens
from pipeline.formats.file_reading import camera_matrix, check_looks_ahead, rigid_transform
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

TF_STATIC = "/tf_static"
_BASES = ("base_link", "base_footprint", "vehicle", "ego_vehicle", "rear_axle")


class TransformTree:
    """Static transforms between frames named by the bag."""

    def __init__(self) -> None:
        self._neighbours: dict[str, dict[str, F64]] = {}

    def add(self, message: Any) -> None:
        """Add a TFMessage. Invalid transforms are skipped."""
        for each in message.transforms:
            try:
                T_parent_child = rigid_transform(_matrix(each.transform), "a transform")
            except SourceError:
                continue
            parent, child = _name(each.header.frame_id), _name(each.child_frame_id)
            self._neighbours.setdefault(parent, {})[child] = T_parent_child
            self._neighbours.setdefault(child, {})[parent] = inverse(T_parent_child)

    def find(self, target: str, source: str) -> F64 | None:
        """T_target_source (4, 4); None when they are not connected."""
        target, source = _name(target), _name(source)
        found: dict[str, F64] = {target: np.eye(4)}
        queue = deque([target])
        while queue:
            here = queue.popleft()
            if here == source:
                return found[here]
            for there, T in self._neighbours.get(here, {}).items():
                if there not in found:
                    found[there] = found[here] @ T
                    queue.append(there)
        return None

    def T_ego_lidar(self, lidar: str) -> F64:
        """(4, 4) the LiDAR's position, with the axes of the car's base frame if the bag has it."""
        for base in _BASES:
            T_base_lidar = self.find(base, lidar)
            if T_base_lidar is not None:
                T = np.eye(4)
                T[:3, :3] = T_base_lidar[:3, :3]
                return T
        return np.eye(4)


def calibration(
    info: Any, tree: TransformTree, lidar: str, T_ego_lidar: F64, notes: list[str]
) -> CameraCalibration | None:
    """The camera of a CameraInfo, relative to the ego frame. None, with the reason in ``notes``, if the bag does not
    contain it."""
    camera = _name(str(info.header.frame_id))
    T_camera_lidar = tree.find(camera, lidar)
    if T_camera_lidar is None:
        notes.append(f"no transform between {lidar} and {camera}: LiDAR and camera are not fused")
        return None
    try:
        K = camera_matrix(np.reshape(np.asarray(_either_case(info, "k"), dtype=np.float64), (3, 3)), "K")
        distortion = polynomial_lens(_either_case(info, "d"), str(info.distortion_model), "distortion")
        size = int(info.width), int(info.height)
        if min(size) < 16:
            raise SourceError("an image without size")
        T_camera_ego = T_camera_lidar @ inverse(T_ego_lidar)
        return _looking_ahead(K, distortion, T_camera_ego, size)
    except (SourceError, ValueError) as error:
        notes.append(f"CameraInfo is not used: {error}")
        return None


def _looking_ahead(K: F64, distortion: F64, T_camera_ego: F64, size: tuple[int, int]) -> CameraCalibration:
    """By REP 103 its frame is the optical one; many bags use the body's, x forward, instead."""
    given = CameraCalibration(K, distortion, T_camera_ego, *size)
    try:
        check_looks_ahead(given, "the transform to the camera")
    except SourceError:
        turned = CameraCalibration(K, distortion, T_OPTICAL_BODY @ T_camera_ego, *size)
        check_looks_ahead(turned, "the transform to the camera")
        return turned
    return given


def _either_case(info: Any, name: str) -> Any:
    """A field that ROS 2 calls ``k`` or ``d``, and ROS 1 ``K`` or ``D``."""
    return getattr(info, name) if hasattr(info, name) else getattr(info, name.upper())


def _matrix(transform: Any) -> F64:
    q, t = transform.rotation, transform.translation
    x, y, z, w = (float(value) for value in (q.x, q.y, q.z, q.w))
    norm = x * x + y * y + z * z + w * w
    if not 0.5 < norm < 2.0:
        return np.empty(0)
    s = 2.0 / norm
    T = np.eye(4)
    T[:3, :3] = [
        [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
    ]
    T[:3, 3] = float(t.x), float(t.y), float(t.z)
    return T


def _name(frame: str) -> str:
    return str(frame).lstrip("/")
