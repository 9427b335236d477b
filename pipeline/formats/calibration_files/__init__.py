"""Camera calibrations in the formats of other tools: the name of each format, its reader and its writer.

Every reader returns a ``CameraCalibration`` whose ego frame is the LiDAR's own. It raises SourceError, with one
sentence, for values that cannot be valid.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, Protocol

from pipeline.common.files.user_file_errors import reason_of
from pipeline.common.files.user_files import LARGEST_TEXT_BYTES, read_regular
from pipeline.formats.calibration_files import kalibr, kitti, opencv, rig, ros
from pipeline.formats.calibration_files.contents import CalibrationFiles, GivenFile
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError


class Parser(Protocol):
    """Reads one format."""

    def __call__(
        self, files: CalibrationFiles, size: tuple[int, int] | None, T_ego_lidar: F64 | None = None, /
    ) -> CameraCalibration:
        """From the file, or the files of ``Format.names``. size: width and height, needed where the file does not say.
        T_ego_lidar: (4, 4), the LiDAR's mount, for the check that the camera looks ahead; None where the LiDAR's own
        frame has x ahead and y to the left."""
        ...


class Format(NamedTuple):
    """One kind of file."""

    title: str
    """For people."""
    parse: Parser | None
    """None: cannot be read."""
    write: Callable[[Path, CameraCalibration], object]
    """To a file or folder."""
    names: tuple[str, ...] = ()
    """Files of a folder; empty for a single file. KITTI's may be either."""
    needs_all: bool = True
    """Whether all files of ``names`` are needed."""

    def read(self, path: Path, size: tuple[int, int] | None) -> CameraCalibration:
        """From a file or folder."""
        if self.parse is None:
            raise SourceError(f"{path.name}: {self.title} cannot be read here")
        is_folder = bool(self.names) and not path.is_file()
        files = [path / name for name in self.names if (path / name).exists()] if is_folder else [path]
        if not files and self.names:
            raise SourceError(f"{path.name}: neither {' nor '.join(self.names)} in it")
        # a file by itself may be called anything: it is the one that suffices without the others
        single = self.names[0] if not is_folder and self.names and not self.needs_all else None
        return self.parse({single or each.name: GivenFile(each.name, _content(each)) for each in files}, size)


FORMATS: Mapping[str, Format] = {
    "kitti": Format("KITTI", kitti.parse, kitti.write, (kitti.CAMERAS, kitti.VELODYNE)),
    "ros": Format("ROS", ros.parse, ros.write, (ros.INFO, ros.TRANSFORM)),
    "opencv": Format("OpenCV", opencv.parse, opencv.write),
    "kalibr": Format("Kalibr", kalibr.parse, kalibr.write, (kalibr.CHAIN, kalibr.TRANSFORM), False),
    "rig": Format("a rig file", None, rig.write),
}


def write_calibration(path: Path, name: str, camera: CameraCalibration, T_ego_lidar: F64 | None) -> None:
    """Write a recording's calibration in a format of ``FORMATS``. T_ego_lidar: (4, 4), the LiDAR's mount; None where
    the ego frame is its own. SourceError if the format cannot represent it."""
    if T_ego_lidar is None:
        FORMATS[name].write(path, camera)
    elif name == "rig":
        rig.write_rig(path, camera, T_ego_lidar)
    else:
        FORMATS[name].write(path, replace(camera, T_camera_ego=camera.T_camera_ego @ T_ego_lidar))


def _content(path: Path) -> bytes:
    try:
        return read_regular(path, LARGEST_TEXT_BYTES)
    except (OSError, ValueError) as error:
        raise SourceError(f"{path.name}: cannot be read: {reason_of(error)}") from None
