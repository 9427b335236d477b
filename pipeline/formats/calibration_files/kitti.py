"""KITTI: the file of the object and tracking benchmarks (P2, R0_rect, Tr_velo_to_cam) or of odometry (P2, Tr), none of
which stores the images' size, or the raw data's ``calib_cam_to_cam.txt`` with ``calib_velo_to_cam.txt``. All are for
undistorted images."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.common.files.output_files import write_new
from pipeline.formats.calibration_files.contents import CalibrationFiles, file_of, the_file
from pipeline.formats.kitti_calibration import (
    parse_key_values,
    parse_object_calibration,
    parse_odometry_calibration,
    parse_raw_calibration,
)
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

CAMERAS, VELODYNE, IMU = "calib_cam_to_cam.txt", "calib_velo_to_cam.txt", "calib_imu_to_velo.txt"
"""Of a day of raw data; the IMU's is not needed."""


def parse(files: CalibrationFiles, size: tuple[int, int] | None, T_ego_lidar: F64 | None = None) -> CameraCalibration:
    if CAMERAS in files or VELODYNE in files:
        cameras, velodyne = file_of(files, CAMERAS), file_of(files, VELODYNE)
        names = cameras.name, velodyne.name
        return parse_raw_calibration(cameras.data, velodyne.data, names, None, T_ego_lidar).camera
    name, data = the_file(files)
    if size is None:
        raise SourceError(f"{name}: KITTI's calibration does not store the image size; specify it")
    parse_one = parse_odometry_calibration if "Tr" in parse_key_values(data) else parse_object_calibration
    return parse_one(data, name, size, T_ego_lidar).camera


def write(path: Path, camera: CameraCalibration) -> None:
    """SourceError for a lens with distortion, which the format cannot represent."""
    if np.any(camera.distortion):
        raise SourceError("KITTI's calibration is for undistorted images; this camera has distortion")
    projection = np.hstack([camera.K, np.zeros((3, 1))])
    rows = {f"P{number}": projection for number in range(4)}
    rows |= {"R0_rect": np.eye(3), "Tr_velo_to_cam": camera.T_camera_ego[:3]}
    write_new(path, "".join(f"{name}: {_numbers(values)}\n" for name, values in rows.items()))


def _numbers(values: F64) -> str:
    return " ".join(f"{value:.12e}" for value in values.ravel())
