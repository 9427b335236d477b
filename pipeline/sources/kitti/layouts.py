"""Where KITTI's layouts keep what: raw drives, the object benchmark's folders, the odometry benchmark's sequences, and
KITTI-360 (``kitti360``).

Raw: ``<date>_drive_NNNN_sync/{image_02,velodyne_points,oxts}/data`` with ``timestamps.txt`` beside each ``data`` and
``calib_cam_to_cam.txt``, ``calib_velo_to_cam.txt`` one folder up. Object form: ``image_02`` (or ``image_2``),
``velodyne``, ``calib``, ``label_2``, one file a frame. Odometry: ``sequences/NN/{image_2,velodyne}`` with ``calib.txt``
and ``times.txt``, and ``poses/NN.txt`` beside ``sequences``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.ego_motion.from_poses import motion_along
from pipeline.formats.file_reading import IMAGE_SUFFIXES, files_by_name, read_bytes
from pipeline.formats.kitti_calibration import KittiCalibration, parse_odometry_calibration
from pipeline.sources.kitti import kitti360
from pipeline.sources.kitti.files import Files, read_stamps
from pipeline.types import EgoState
from pipeline.types.source import SourceError

_BEGIN_NS = 1_000_000_000
"""Odometry sequences count seconds from 0, which elsewhere means a missing timestamp."""
_LONGEST_S = 1e7
"""Maximum duration of a drive: four months."""


def files_of(folder: Path) -> Files:
    """Files in a recording's folder."""
    named = kitti360.root_of(folder)
    if named is not None:
        root, drive = named
        return kitti360.files_of_drive(root, drive) if drive is not None else Files({}, {})
    if any((folder / sensor / "data").is_dir() for sensor in ("velodyne_points", "image_02")):
        return _raw(folder)
    return _sequence(folder) if (folder / "calib.txt").is_file() else _object(folder)


def _raw(folder: Path) -> Files:
    names = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt")
    home = folder.resolve().parent if not (folder / names[0]).exists() else folder
    return Files(
        images=files_by_name(folder / "image_02" / "data", IMAGE_SUFFIXES),
        sweeps=files_by_name(folder / "velodyne_points" / "data", (".bin",)),
        oxts=files_by_name(folder / "oxts" / "data", (".txt",)),
        raw_calibration=(home / names[0], home / names[1]),
        lidar_stamps=read_stamps(folder / "velodyne_points" / "timestamps.txt"),
        camera_stamps=read_stamps(folder / "image_02" / "timestamps.txt"),
    )


def _object(folder: Path) -> Files:
    images = files_by_name(folder / "image_02", IMAGE_SUFFIXES)
    return Files(
        images=images or files_by_name(folder / "image_2", IMAGE_SUFFIXES),
        sweeps=files_by_name(folder / "velodyne", (".bin",)),
        labels=files_by_name(folder / "label_2", (".txt",)),
        calibrations=files_by_name(folder / "calib", (".txt",)),
    )


def _sequence(folder: Path) -> Files:
    home = folder.resolve()
    poses = [home / "poses.txt", home.parent.parent / "poses" / f"{home.name}.txt"]
    return Files(
        images=files_by_name(folder / "image_2", IMAGE_SUFFIXES),
        sweeps=files_by_name(folder / "velodyne", (".bin",)),
        lidar_stamps=_read_seconds(folder / "times.txt"),
        sequence_calibration=folder / "calib.txt",
        poses=next((path for path in poses if path.is_file()), None),
    )


def motion_of(files: Files, calibration: KittiCalibration) -> list[EgoState | None]:
    """Own motion in each frame of a sequence from its poses, over the neighbouring frames; empty without poses.
    SourceError for invalid poses."""
    if files.camera_poses is not None and len(files.lidar_stamps) > 1:
        return kitti360.motion_of_camera(files.camera_poses, files.lidar_stamps, calibration.T_rect_ego)
    if files.poses is None or len(files.lidar_stamps) < 2:
        return []
    try:
        rows = np.array([line.split() for line in read_bytes(files.poses).decode().splitlines() if line], dtype=float)
        T_start_camera = np.tile(np.eye(4), (len(rows), 1, 1))
        T_start_camera[:, :3] = rows.reshape(-1, 3, 4)
        if not (np.abs(T_start_camera) < kitti360.BEYOND_ANY_MAP_M).all():
            raise ValueError
    except ValueError:
        raise SourceError(f"{files.poses.name}: expected poses of 12 numbers per line") from None
    T = T_start_camera @ calibration.T_rect_ego
    count = min(len(T), len(files.lidar_stamps))
    return motion_along(files.lidar_stamps[:count], list(T[:count]))


def sequence_calibration(path: Path, size: tuple[int, int]) -> KittiCalibration:
    """Calibration of a sequence. SourceError names the file and what is wrong."""
    return parse_odometry_calibration(read_bytes(path), path.name, size)


def _read_seconds(path: Path) -> tuple[int, ...]:
    """Nanoseconds from each line; empty if there is no such file or a line is not a time."""
    try:
        seconds = [float(line) for line in read_bytes(path).split()]
    except (SourceError, ValueError):
        return ()
    if not all(0.0 <= each < _LONGEST_S for each in seconds):
        return ()
    return tuple(_BEGIN_NS + round(each * 1e9) for each in seconds)
