"""Small recordings written to disk in each layout, so that the readers are tested without the real data."""

from __future__ import annotations

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.common.geometry import inverse, rotation

LIDAR_ROWS = [
    "10.00 0.00 -1.00 7 0 1000000",
    "10.00 1.00 0.50 8 1 1000005",
    "12.00 -1.00 -0.80 90 2 1000009",
    "20.00 0.50 0.20 33 15 1000014",
]
CAMERA_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Columns: the camera's x, y and z axes in the ego frame, for a camera that looks along ego +x."""


def astyx_calibration() -> dict[str, object]:
    lidar, camera = np.eye(4), np.eye(4)
    lidar[:3, :3], lidar[:3, 3] = rotation(0.0, 0.0, 0.1), (0.5, -0.2, 0.3)
    camera[:3, :3], camera[:3, 3] = CAMERA_AXES, (-1.0, 0.1, 1.2)
    K = [[100.0, 0.0, 80.0], [0.0, 100.0, 30.0], [0.0, 0.0, 1.0]]
    return {
        "sensors": [
            {"sensor_uid": "radar_6455", "calib_data": {"T_to_ref_COS": np.eye(4).tolist()}},
            {"sensor_uid": "lidar_vlp16", "calib_data": {"T_to_ref_COS": lidar.tolist()}},
            {"sensor_uid": "camera_front", "calib_data": {"K": K, "T_to_ref_COS": camera.tolist()}},
        ]
    }


def write_astyx(folder: Path, names: tuple[str, ...] = ("000001", "000002")) -> Path:
    for name in ("lidar_vlp16", "camera_front", "calibration", "groundtruth_obj3d"):
        (folder / name).mkdir(parents=True)
    for i, name in enumerate(names):
        shifted = [row[:-7] + str(int(row[-7:]) + 300_000 * i) for row in LIDAR_ROWS]
        text = "\n".join(["X Y Z Reflectivity LaserID Timestamp ", *shifted]) + "\n"
        (folder / "lidar_vlp16" / f"{name}.txt").write_text(text)
        cv2.imwrite(str(folder / "camera_front" / f"{name}.jpg"), np.full((60, 160, 3), 40 * i + 50, dtype=np.uint8))
        (folder / "calibration" / f"{name}.json").write_text(json.dumps(astyx_calibration()))
        box = {
            "classname": "Car",
            "center3d": [20.0, 1.0, 0.5],
            "dimension3d": [4.2, 1.8, 1.5],
            "orientation_quat": [np.cos(0.15), 0.0, 0.0, np.sin(0.15)],
            "object_id": -1,
        }
        (folder / "groundtruth_obj3d" / f"{name}.json").write_text(json.dumps({"objects": [box]}))
    return folder


def rings_file(count: int = 64, columns: int = 40) -> bytes:
    """A Velodyne file with rings from +2° down to −23.5°, highest first, each counter-clockwise from straight ahead."""
    elevation = np.radians(np.linspace(2.0, -23.5, count))[:, None]
    azimuth = np.radians(np.linspace(0.5, 359.5, columns))[None, :]
    x, y = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth)
    z = np.broadcast_to(np.sin(elevation), x.shape)
    points = np.stack([20 * x, 20 * y, 20 * z, np.full_like(x, 0.5)], axis=2)
    return points.reshape(-1, 4).astype("<f4").tobytes()


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{value:.9e}" for value in values.ravel())


KITTI_K = np.array([[700.0, 0.0, 60.0], [0.0, 700.0, 20.0], [0.0, 0.0, 1.0]])
KITTI_BASELINE_M = 0.06
KITTI_LABEL = "Car 0.00 0 0.1 10 10 50 30 1.50 1.60 4.00 -1.00 1.70 12.00 -1.5707963"


def velo_to_cam() -> np.ndarray:
    return np.hstack([CAMERA_AXES.T, [[0.0], [-0.1], [-0.3]]])


def projection() -> np.ndarray:
    return np.hstack([KITTI_K, KITTI_K @ [[KITTI_BASELINE_M], [0.0], [0.0]]])


def object_calibration() -> str:
    return f"P2: {_numbers(projection())}\nR0_rect: {_numbers(np.eye(3))}\nTr_velo_to_cam: {_numbers(velo_to_cam())}\n"


def write_kitti(folder: Path) -> Path:
    for name in ("velodyne", "image_02", "calib", "label_2"):
        (folder / name).mkdir(parents=True)
    for i in range(3):
        (folder / "velodyne" / f"{i:010d}.bin").write_bytes(rings_file())
        cv2.imwrite(str(folder / "image_02" / f"{i:010d}.png"), np.full((40, 120, 3), 30 * i, dtype=np.uint8))
    (folder / "calib" / "0000000001.txt").write_text(object_calibration())
    dont_care = "DontCare -1 -1 -10 1 1 2 2 -1 -1 -1 -1000 -1000 -1000 -10"
    (folder / "label_2" / "0000000001.txt").write_text(f"{KITTI_LABEL}\n{dont_care}\n")
    return folder


def write_kitti_raw(date: Path) -> Path:
    drive = date / "2011_09_26_drive_0009_sync"
    for sensor in ("velodyne_points", "image_02", "oxts"):
        (drive / sensor / "data").mkdir(parents=True)
    stamps = "".join(f"2011-09-26 13:04:32.{100 + 103 * i:03d}000512\n" for i in range(4))
    (drive / "velodyne_points" / "timestamps.txt").write_text(stamps)
    (drive / "image_02" / "timestamps.txt").write_text(stamps.replace("000512", "004000"))
    for i in (0, 1, 3):  # frame 2 has no sweep
        (drive / "velodyne_points" / "data" / f"{i:010d}.bin").write_bytes(rings_file())
    for i in range(4):
        cv2.imwrite(str(drive / "image_02" / "data" / f"{i:010d}.png"), np.zeros((40, 120, 3), dtype=np.uint8))
        record = [0.0] * 30
        record[8], record[22] = 13.5 + i, 0.02
        record[0], record[1], record[2] = 49.0, 8.4, 112.0
        record[5], record[6], record[7] = math.pi / 2, 13.5 + i, 0.0  # the car drives north
        record[23], record[27] = 0.04, 5.0 if i else 2.0
        (drive / "oxts" / "data" / f"{i:010d}.txt").write_text(" ".join(map(str, record)))
    head = "calib_time: 09-Jan-2012 13:57:47\n"
    cameras = f"{head}S_rect_02: 120 40\nR_rect_00: {_numbers(np.eye(3))}\nP_rect_02: {_numbers(projection())}\n"
    (date / "calib_cam_to_cam.txt").write_text(cameras)
    tr = velo_to_cam()
    (date / "calib_velo_to_cam.txt").write_text(f"{head}R: {_numbers(tr[:, :3])}\nT: {_numbers(tr[:, 3])}\n")
    return drive


def T_ego_rect() -> np.ndarray:
    full = np.eye(4)
    full[:3] = velo_to_cam()
    return inverse(full)


@pytest.fixture
def astyx(tmp_path: Path) -> Path:
    return write_astyx(tmp_path / "astyx")


@pytest.fixture
def kitti(tmp_path: Path) -> Path:
    return write_kitti(tmp_path / "kitti")


@pytest.fixture
def kitti_raw(tmp_path: Path) -> Path:
    return write_kitti_raw(tmp_path / "2011_09_26")
