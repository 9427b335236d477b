"""What a recording in one of KITTI's layouts consists of."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from pipeline.formats.file_reading import in_order, read_bytes
from pipeline.formats.kitti_records import parse_timestamps
from pipeline.types.source import SourceError


@dataclass(frozen=True)
class Files:
    """Files of a recording by type and frame name; timestamps by frame number."""

    images: dict[str, Path]
    """Images by frame name."""
    sweeps: dict[str, Path]
    """Point clouds by frame name."""
    lidar_stamps: tuple[int, ...] = ()
    """Nanoseconds; empty if the layout has none."""
    camera_stamps: tuple[int, ...] = ()
    """Nanoseconds; empty if the layout has none."""
    oxts: dict[str, Path] = field(default_factory=dict)
    """Records of the inertial unit, by frame name."""
    labels: dict[str, Path] = field(default_factory=dict)
    """Object benchmark: by frame name."""
    calibrations: dict[str, Path] = field(default_factory=dict)
    """Object benchmark: by frame name."""
    raw_calibration: tuple[Path, Path] | None = None
    """Raw drives: of the cameras, and of the Velodyne."""
    sequence_calibration: Path | None = None
    """Odometry sequences: one file for all frames."""
    poses: Path | None = None
    """Odometry sequences: poses of the left camera, one line per frame."""
    calibration_360: tuple[Path, Path] | None = None
    """KITTI-360: of the Velodyne, and of the cameras."""
    camera_poses: Path | None = None
    """KITTI-360: poses of the left camera, by frame number."""

    @property
    def names(self) -> list[str]:
        """Of every frame, in order."""
        return in_order(self.sweeps.keys() | self.images.keys())


def read_stamps(path: Path) -> tuple[int, ...]:
    """Nanoseconds from each line of ``timestamps.txt``; empty if there is no such file."""
    try:
        return parse_timestamps(read_bytes(path))
    except SourceError:
        return ()
