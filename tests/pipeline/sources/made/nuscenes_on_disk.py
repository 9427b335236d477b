"""A small data set in nuScenes' layout, written according to its published schema: one or two scenes with a round wall,
a car on an arc, and boxes in the key frames."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pipeline.common.geometry import rotation
from pipeline.types import F32, F64

START_US, STEP_US = 1_532_402_927_647_951, 50_000
SPEED_MPS, YAW_RATE_RADPS = 10.0, 0.2
LIDAR_AT, CAMERA_AT = (0.94, 0.0, 1.84), (1.7, 0.0, 1.5)
BOX_AT, BOX_SIZE = (20.0, 3.0, 0.9), (1.9, 4.6, 1.7)
"""Position in the car's frame at the first sweep; width, length, height."""
_LIDAR_YAW = -np.pi / 2
"""The sensor's y axis points ahead."""
_CAMERA_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def write_nuscenes(folder: Path, frames: int = 12, scenes: int = 1, cloud: Callable[[int], F32] | None = None) -> Path:
    """Write the data set. frames: number of sweeps per scene; every tenth is a key frame. cloud: returns (N, 5) ``x y z
    intensity ring`` of a sweep in the sensor's frame."""
    for name in ("samples/LIDAR_TOP", "sweeps/LIDAR_TOP", "samples/CAM_FRONT", "sweeps/CAM_FRONT", "v1.0-mini", "maps"):
        (folder / name).mkdir(parents=True)
    tables: dict[str, list[dict[str, Any]]] = {
        name: [] for name in ("scene", "sample", "sample_data", "ego_pose", "sample_annotation", "instance")
    }
    for scene in range(scenes):
        _write_scene(folder, tables, scene, frames, cloud or (lambda index: wall()))
    tables["category"] = [{"token": "c1", "name": "vehicle.car", "description": ""}]
    tables["sensor"] = [
        {"token": "s1", "channel": "LIDAR_TOP", "modality": "lidar"},
        {"token": "s2", "channel": "CAM_FRONT", "modality": "camera"},
    ]
    lidar = {"token": "l", "sensor_token": "s1", "translation": LIDAR_AT, "camera_intrinsic": []}
    camera = {"token": "k", "sensor_token": "s2", "translation": CAMERA_AT}
    camera |= {"camera_intrinsic": [[126.0, 0.0, 80.0], [0.0, 126.0, 45.0], [0.0, 0.0, 1.0]]}
    tables["calibrated_sensor"] = [
        lidar | {"rotation": quaternion(rotation(0.0, 0.0, _LIDAR_YAW))},
        camera | {"rotation": quaternion(_CAMERA_AXES)},
    ]
    for name, rows in tables.items():
        (folder / "v1.0-mini" / f"{name}.json").write_text(json.dumps(rows))
    return folder


def _write_scene(
    folder: Path, tables: dict[str, list[dict[str, Any]]], scene: int, frames: int, cloud: Callable[[int], F32]
) -> None:
    name = f"scene-{61 + 42 * scene:04d}"
    tables["scene"].append({"token": name, "name": name, "nbr_samples": (frames + 9) // 10, "description": ""})
    tables["instance"].append({"token": f"{name} car", "category_token": "c1"})
    for index in range(frames):
        t_us, is_key = START_US + scene * 60_000_000 + index * STEP_US, index % 10 == 0
        sample, place = f"{name} {index // 10}", "samples" if is_key else "sweeps"
        T = car_at(index * STEP_US / 1e6)
        pose = {"translation": T[:3, 3].tolist(), "rotation": quaternion(T[:3, :3])}
        if is_key:
            tables["sample"].append({"token": sample, "scene_token": name, "timestamp": t_us})
            box = car_at(0.0) @ _at(BOX_AT)
            row = {"token": f"{sample} box", "sample_token": sample, "instance_token": f"{name} car"}
            row |= {"translation": box[:3, 3].tolist(), "size": BOX_SIZE, "rotation": quaternion(box[:3, :3])}
            tables["sample_annotation"].append(row)
        for channel, sensor, suffix, late_us in (
            ("LIDAR_TOP", "l", ".pcd.bin", 0),
            ("CAM_FRONT", "k", ".jpg", -35_000),
        ):
            file = f"{place}/{channel}/n015__{channel}__{t_us + late_us}{suffix}"
            if channel == "LIDAR_TOP":
                (folder / file).write_bytes(cloud(index).astype("<f4").tobytes())
            else:
                cv2.imwrite(str(folder / file), np.full((90, 160, 3), 40 + index, np.uint8))
            token = f"{name} {channel} {index}"
            tables["ego_pose"].append({"token": token, "timestamp": t_us + late_us} | pose)
            row = {"token": token, "sample_token": sample, "ego_pose_token": token, "calibrated_sensor_token": sensor}
            row |= {"timestamp": t_us + late_us, "filename": file, "is_key_frame": is_key, "fileformat": suffix}
            tables["sample_data"].append(row)


def wall(ahead_m: float = 12.0) -> F32:
    """(N, 5): a wall straight ahead as seen by 32 rings; its left half is bright."""
    left, up = np.meshgrid(np.linspace(-4.0, 4.0, 41), np.linspace(-1.5, 1.5, 32))
    ring = np.repeat(np.arange(32), 41)
    intensity = np.where(left.ravel() > 0, 200.0, 20.0)
    return np.column_stack([-left.ravel(), np.full(left.size, ahead_m), up.ravel(), intensity, ring]).astype(np.float32)


def car_at(t_s: float) -> F64:
    """(4, 4) pose of the car on the map: on an arc, far from the map's origin."""
    heading = 0.7 + YAW_RATE_RADPS * t_s
    radius = SPEED_MPS / YAW_RATE_RADPS
    T = np.eye(4)
    T[:3, :3] = rotation(0.0, 0.0, heading)
    T[:3, 3] = 400.0 + radius * np.sin(heading), 1100.0 - radius * np.cos(heading), 0.0
    return T


def _at(place: Sequence[float]) -> F64:
    T = np.eye(4)
    T[:3, 3] = place
    return T


def quaternion(R: F64) -> list[float]:
    """The quaternion w x y z of a rotation matrix."""
    vector, _ = cv2.Rodrigues(R)
    angle = float(np.linalg.norm(vector))
    axis = vector.ravel() / angle if angle > 1e-12 else np.zeros(3)
    return [float(np.cos(angle / 2)), *(float(each) for each in np.sin(angle / 2) * axis)]
