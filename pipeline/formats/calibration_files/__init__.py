"""Camera calibrations in the formats of other tools: the name of each format, its reader and its writer.

Every reader returns a ``CameraCalibration`` whose ego frame is the LiDAR's own. It raises SourceError, with one
sentence, for values that cannot be valid.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from pipeline.formats.calibration_files import kalibr, kitti, opencv, rig, ros
from pipeline.types import CameraCalibration


class Format(NamedTuple):
    """One kind of file."""

    read: Callable[[Path, tuple[int, int] | None], CameraCalibration] | None
    """From a file or folder. The size (width, height) is needed where the file does not say; None: cannot be read."""
    write: Callable[[Path, CameraCalibration], object]
    """To a file or folder."""


FORMATS: Mapping[str, Format] = {
    "kitti": Format(kitti.read, kitti.write),
    "ros": Format(ros.read, ros.write),
    "opencv": Format(opencv.read, opencv.write),
    "kalibr": Format(kalibr.read, kalibr.write),
    "rig": Format(None, rig.write),
}
