"""KITTI's calibration files: one per frame (object benchmark), two per day (raw data), or one set for all (KITTI-360).

Geiger et al. 2013, "Vision meets Robotics: The KITTI Dataset", section 3 and Eq. 3–6: R0_rect · Tr_velo_to_cam takes a
Velodyne point to the rectified camera 0, and P2, whose last column contains the baseline from camera 0 to camera 2,
takes it to the image of camera 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.geometry import inverse
from pipeline.formats.file_reading import camera_matrix, check_looks_ahead, rigid_transform
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

_LARGEST_PX = 100_000
_TRACKING = {"R_rect": "R0_rect", "Tr_velo_cam": "Tr_velo_to_cam"}
_VELODYNE_HEIGHT_M = 1.73
"""Above the road (Geiger et al. 2013, figure 3)."""


@dataclass(frozen=True)
class KittiCalibration:
    """What the product needs of KITTI's many transforms."""

    T_rect_ego: F64
    """(4, 4), takes Velodyne points to the rectified camera 0, where labels are."""
    camera: CameraCalibration
    """Camera 2, the left colour camera; of KITTI-360 camera 0, the left one."""


def parse_object_calibration(
    data: bytes, file: str, size: tuple[int, int], T_ego_lidar: F64 | None = None
) -> KittiCalibration:
    """``calib/NNNNNN.txt`` with P2, R0_rect and Tr_velo_to_cam, which the tracking benchmark calls R_rect and
    Tr_velo_cam. T_ego_lidar: as for ``check_looks_ahead``. SourceError names the file and what is wrong."""
    table = {_TRACKING.get(name, name): numbers for name, numbers in parse_key_values(data).items()}
    projection = _values(table, "P2", (3, 4), file)
    rectify = _values(table, "R0_rect", (3, 3), file)
    to_camera = _values(table, "Tr_velo_to_cam", (3, 4), file)
    return _calibration(projection, rectify, to_camera, file, size, T_ego_lidar)


def parse_odometry_calibration(
    data: bytes, file: str, size: tuple[int, int], T_ego_lidar: F64 | None = None
) -> KittiCalibration:
    """A sequence's ``calib.txt`` with P2 and Tr, which goes from the Velodyne to the rectified camera 0. T_ego_lidar:
    as for ``check_looks_ahead``. SourceError names the file and what is wrong."""
    table = parse_key_values(data)
    projection, to_camera = _values(table, "P2", (3, 4), file), _values(table, "Tr", (3, 4), file)
    return _calibration(projection, np.eye(3), to_camera, file, size, T_ego_lidar)


def parse_raw_calibration(
    cam_to_cam: bytes,
    velo_to_cam: bytes,
    files: tuple[str, str],
    size: tuple[int, int] | None,
    T_ego_lidar: F64 | None = None,
) -> KittiCalibration:
    """``calib_cam_to_cam.txt`` (P_rect_02, R_rect_00) and ``calib_velo_to_cam.txt`` (R, T); ``files`` are their names.
    size: of the images; None takes that of the file, S_rect_02. T_ego_lidar: as for ``check_looks_ahead``. SourceError
    names the file and what is wrong."""
    cameras, velodyne = parse_key_values(cam_to_cam), parse_key_values(velo_to_cam)
    projection = _values(cameras, "P_rect_02", (3, 4), files[0])
    rectify = _values(cameras, "R_rect_00", (3, 3), files[0])
    to_camera = np.hstack([_values(velodyne, "R", (3, 3), files[1]), _values(velodyne, "T", (3, 1), files[1])])
    if size is None:
        width, height = _values(cameras, "S_rect_02", (2,), files[0]).tolist()
        if not (16 <= width <= _LARGEST_PX and 16 <= height <= _LARGEST_PX):
            raise SourceError(f"calibration {files[0]}: S_rect_02 is not an image size")
        size = round(width), round(height)
    return _calibration(projection, rectify, to_camera, files[1], size, T_ego_lidar)


def parse_360_calibration(
    cam_to_velo: bytes, perspective: bytes, files: tuple[str, str], size: tuple[int, int]
) -> KittiCalibration:
    """KITTI-360's ``calib_cam_to_velo.txt`` (12 numbers, from camera 0 to the Velodyne) and ``perspective.txt``
    (P_rect_00, R_rect_00); ``files`` are their names. SourceError names the file and what is wrong."""
    numbers = parse_number_lines(cam_to_velo, 12)
    if len(numbers) != 1:
        raise SourceError(f"calibration {files[0]}: not one line of 12 numbers")
    T_ego_cam = rigid_transform(numbers.reshape(3, 4), f"calibration {files[0]}: camera to Velodyne")
    table = parse_key_values(perspective)
    projection = _values(table, "P_rect_00", (3, 4), files[1])
    rectify = _values(table, "R_rect_00", (3, 3), files[1])
    return _calibration(projection, rectify, inverse(T_ego_cam)[:3], files[1], size)


def parse_key_values(data: bytes) -> dict[str, list[float]]:
    """Lines ``name: number number …``, of which some of the tracking benchmark lack the colon; lines of anything else
    (dates, text) are passed over."""
    table: dict[str, list[float]] = {}
    for line in data.decode("utf-8", "replace").splitlines():
        name, _, rest = line.partition(":" if ":" in line else " ")
        try:
            numbers = [float(word) for word in rest.split()]
        except ValueError:
            continue
        if numbers and not name[:1].isdigit():
            table[name.strip()] = numbers
    return table


def parse_number_lines(data: bytes, columns: int) -> F64:
    """(N, columns) float64 of the lines that are exactly so many finite numbers, of any number of digits."""
    rows = []
    for line in data.decode("utf-8", "replace").splitlines():
        try:
            numbers = [float(word) for word in line.split()]
        except ValueError:
            continue
        if len(numbers) == columns and np.isfinite(numbers).all():
            rows.append(numbers)
    return np.array(rows, dtype=np.float64).reshape(-1, columns)


def _values(table: dict[str, list[float]], name: str, shape: tuple[int, ...], file: str) -> F64:
    numbers = table.get(name)
    if numbers is None or len(numbers) != int(np.prod(shape)):
        raise SourceError(f"calibration {file}: no {name} of {'×'.join(map(str, shape))} numbers")
    return np.array(numbers, dtype=np.float64).reshape(shape)


def _calibration(
    projection: F64,
    rectify: F64,
    velo_to_cam: F64,
    file: str,
    size: tuple[int, int],
    T_ego_lidar: F64 | None = None,
) -> KittiCalibration:
    K = camera_matrix(projection[:, :3], f"calibration {file}: the projection of the camera")
    T_rect_cam = rigid_transform(np.hstack([rectify, np.zeros((3, 1))]), f"calibration {file}: the rectification")
    T_cam_ego = rigid_transform(velo_to_cam, f"calibration {file}: Velodyne to camera")
    baseline = np.hstack([np.eye(3), np.linalg.solve(K, projection[:, 3:])])
    T_camera2_rect = rigid_transform(baseline, f"calibration {file}: the baseline of the camera")
    T_rect_ego = T_rect_cam @ T_cam_ego
    camera = CameraCalibration(K, np.empty(0), T_camera2_rect @ T_rect_ego, *size, road_z_m=-_VELODYNE_HEIGHT_M)
    check_looks_ahead(camera, f"calibration {file}", T_ego_lidar)
    return KittiCalibration(T_rect_ego, camera)
