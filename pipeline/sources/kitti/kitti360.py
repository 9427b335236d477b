"""KITTI-360 (Liao, Xie and Geiger 2022): where it keeps what, by its published documentation.

``data_3d_raw/DRIVE/velodyne_points/data``, ``data_2d_raw/DRIVE/image_00/data_rect``, ``timestamps.txt`` beside each,
``data_poses/DRIVE/{cam0_to_world.txt,oxts/data}`` and ``calibration/{calib_cam_to_velo,perspective}.txt``. The front
camera is camera 0, the left one, rectified.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.ego_motion.from_poses import motion_along, motion_between
from pipeline.formats.file_reading import IMAGE_SUFFIXES, files_by_name, read_bytes
from pipeline.formats.kitti_calibration import parse_number_lines
from pipeline.sources.kitti.files import Files, read_stamps
from pipeline.types import F64, EgoState
from pipeline.types.source import SourceError

_SWEEPS, _IMAGES = "data_3d_raw", "data_2d_raw"
BEYOND_ANY_MAP_M = 1e8
"""Ten times the largest coordinate of a map of the Earth (UTM): a number of a pose that large is damaged."""


def root_of(folder: Path) -> tuple[Path, str | None] | None:
    """The data set's folder and the drive named by a path, None for the whole data set; None for any other path."""
    if any((folder / part).is_dir() for part in (_SWEEPS, _IMAGES)):
        drives = drives_in(folder)
        return folder, drives[0] if len(drives) == 1 else None
    home = folder.resolve()
    return (home.parent.parent, home.name) if home.parent.name in (_SWEEPS, _IMAGES) else None


def drives_in(root: Path) -> list[str]:
    """Names of the drives with sweeps or images."""
    return sorted({each.name for part in (_SWEEPS, _IMAGES) for each in (root / part).glob("*") if each.is_dir()})


def files_of_drive(root: Path, drive: str) -> Files:
    """Files of a drive in the data set."""
    velodyne, camera = root / _SWEEPS / drive / "velodyne_points", root / _IMAGES / drive / "image_00"
    poses = root / "data_poses" / drive
    camera_poses = poses / "cam0_to_world.txt"
    return Files(
        images=files_by_name(camera / "data_rect", IMAGE_SUFFIXES),
        sweeps=files_by_name(velodyne / "data", (".bin",)),
        lidar_stamps=read_stamps(velodyne / "timestamps.txt"),
        camera_stamps=read_stamps(camera / "timestamps.txt"),
        oxts=files_by_name(poses / "oxts" / "data", (".txt",)),
        calibration_360=(root / "calibration" / "calib_cam_to_velo.txt", root / "calibration" / "perspective.txt"),
        camera_poses=camera_poses if camera_poses.is_file() else None,
    )


def motion_of_camera(path: Path, stamps: Sequence[int], T_rect_ego: F64) -> list[EgoState | None]:
    """Own motion in each frame from ``cam0_to_world.txt``: a frame number and 16 numbers of T_map_rect per line. Frames
    without a pose get the motion between the poses around them. SourceError for an invalid file."""
    rows = parse_number_lines(read_bytes(path), 17)
    rows = rows[(np.abs(rows) < BEYOND_ANY_MAP_M).all(axis=1)]
    number = rows[:, 0].astype(np.int64)
    good = (number >= 0) & (number < len(stamps)) & (np.diff(number, prepend=-1) > 0)
    rows, number = rows[good], number[good]
    if len(rows) < 2:
        raise SourceError(f"{path.name}: not poses of 17 numbers a line")
    T_map_ego = list(rows[:, 1:].reshape(-1, 4, 4) @ T_rect_ego)
    times = [stamps[k] for k in number.tolist()]
    found: list[EgoState | None] = [None] * len(stamps)
    for k, own in zip(number.tolist(), motion_along(times, T_map_ego), strict=True):
        found[k] = own
    for at in np.flatnonzero(np.diff(number) > 1).tolist():
        for k in range(int(number[at]) + 1, int(number[at + 1])):
            found[k] = motion_between(times[at : at + 2], T_map_ego[at : at + 2], stamps[k])
    return found
