"""Where KITTI's three layouts keep what: raw drives, the object benchmark's folders, and the odometry benchmark's
sequences.

Raw: ``<date>_drive_NNNN_sync/{image_02,velodyne_points,oxts}/data`` with ``timestamps.txt`` beside each ``data`` and
``calib_cam_to_cam.txt``, ``calib_velo_to_cam.txt`` one folder up. Object form: ``image_02`` (or ``image_2``),
``velodyne``, ``calib``, ``label_2``, one file a frame. Odometry: ``sequences/NN/{image_2,velodyne}`` with ``calib.txt``
and ``times.txt``, and ``poses/NN.txt`` beside ``sequences``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pipeline.formats.file_reading import files_by_name, in_order, read_bytes
from pipeline.formats.kitti_calibration import KittiCalibration, parse_odometry_calibration
from pipeline.formats.kitti_records import parse_timestamps
from pipeline.types import F64, EgoState
from pipeline.types.source import SourceError

_IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
_BEGIN_NS = 1_000_000_000
"""Odometry sequences count seconds from 0, which elsewhere means that there is no stamp."""


@dataclass(frozen=True)
class Files:
    """Where a recording keeps what; files by frame name, stamps by frame number."""

    images: dict[str, Path]
    """Images by frame name."""
    sweeps: dict[str, Path]
    """Point clouds by frame name."""
    lidar_stamps: tuple[int, ...] = ()
    """Nanoseconds; empty where the layout has none."""
    camera_stamps: tuple[int, ...] = ()
    """Nanoseconds; empty where the layout has none."""
    oxts: dict[str, Path] = field(default_factory=dict)
    """Records of the inertial unit, by frame name."""
    labels: dict[str, Path] = field(default_factory=dict)
    """Object benchmark: by frame name."""
    calibrations: dict[str, Path] = field(default_factory=dict)
    """Object benchmark: by frame name."""
    raw_calibration: tuple[Path, Path] | None = None
    """Raw drives: of the cameras, and of the Velodyne."""
    sequence_calibration: Path | None = None
    """Odometry sequences: one file for all."""
    poses: Path | None = None
    """Odometry sequences: where the left camera was, a line a frame."""

    @property
    def names(self) -> list[str]:
        """Of every frame, in order."""
        return in_order(self.sweeps.keys() | self.images.keys())


def files_of(folder: Path) -> Files:
    """What lies in a recording's folder."""
    if any((folder / sensor / "data").is_dir() for sensor in ("velodyne_points", "image_02")):
        return _raw(folder)
    return _sequence(folder) if (folder / "calib.txt").is_file() else _object(folder)


def _raw(folder: Path) -> Files:
    names = ("calib_cam_to_cam.txt", "calib_velo_to_cam.txt")
    home = folder.resolve().parent if not (folder / names[0]).exists() else folder
    return Files(
        images=files_by_name(folder / "image_02" / "data", _IMAGE_SUFFIXES),
        sweeps=files_by_name(folder / "velodyne_points" / "data", (".bin",)),
        oxts=files_by_name(folder / "oxts" / "data", (".txt",)),
        raw_calibration=(home / names[0], home / names[1]),
        lidar_stamps=_read_stamps(folder / "velodyne_points" / "timestamps.txt"),
        camera_stamps=_read_stamps(folder / "image_02" / "timestamps.txt"),
    )


def _object(folder: Path) -> Files:
    images = files_by_name(folder / "image_02", _IMAGE_SUFFIXES)
    return Files(
        images=images or files_by_name(folder / "image_2", _IMAGE_SUFFIXES),
        sweeps=files_by_name(folder / "velodyne", (".bin",)),
        labels=files_by_name(folder / "label_2", (".txt",)),
        calibrations=files_by_name(folder / "calib", (".txt",)),
    )


def _sequence(folder: Path) -> Files:
    home = folder.resolve()
    poses = [home / "poses.txt", home.parent.parent / "poses" / f"{home.name}.txt"]
    return Files(
        images=files_by_name(folder / "image_2", _IMAGE_SUFFIXES),
        sweeps=files_by_name(folder / "velodyne", (".bin",)),
        lidar_stamps=_read_seconds(folder / "times.txt"),
        sequence_calibration=folder / "calib.txt",
        poses=next((path for path in poses if path.is_file()), None),
    )


def motion_of(files: Files, calibration: KittiCalibration) -> list[EgoState]:
    """Own motion in each frame of a sequence from its poses, over the frames before and after it; empty without any.
    SourceError for poses that are none."""
    if files.poses is None or len(files.lidar_stamps) < 2:
        return []
    try:
        rows = np.array([line.split() for line in read_bytes(files.poses).decode().splitlines() if line], dtype=float)
        T_start_camera = np.tile(np.eye(4), (len(rows), 1, 1))
        T_start_camera[:, :3] = rows.reshape(-1, 3, 4)
    except ValueError:
        raise SourceError(f"{files.poses.name}: expected poses of 12 numbers per line") from None
    T = T_start_camera @ calibration.T_rect_ego
    last = min(len(T), len(files.lidar_stamps)) - 1
    return [
        _between(T[max(k - 1, 0)], T[min(k + 1, last)], files, max(k - 1, 0), min(k + 1, last), k)
        for k in range(last + 1)
    ]


def _between(before: F64, after: F64, files: Files, first: int, last: int, now: int) -> EgoState:
    seconds = max((files.lidar_stamps[last] - files.lidar_stamps[first]) / 1e9, 1e-3)
    step = np.linalg.inv(before) @ after
    turned = float(np.arctan2(step[1, 0], step[0, 0]))
    moved = float(step[0, 3] * np.cos(turned / 2) + step[1, 3] * np.sin(turned / 2))
    return EgoState(files.lidar_stamps[now], moved / seconds, turned / seconds, source="ins")


def sequence_calibration(path: Path, size: tuple[int, int]) -> KittiCalibration:
    """Of a sequence. SourceError names the file and what is wrong."""
    return parse_odometry_calibration(read_bytes(path), path.name, size)


def _read_stamps(path: Path) -> tuple[int, ...]:
    try:
        return parse_timestamps(path.read_bytes())
    except OSError:
        return ()


def _read_seconds(path: Path) -> tuple[int, ...]:
    try:
        return tuple(_BEGIN_NS + round(float(line) * 1e9) for line in path.read_text().split())
    except (OSError, ValueError):
        return ()
