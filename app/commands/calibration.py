"""`cipv calibration`: read a camera calibration, check it, and write it in another format."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from app.commands.support.arguments import option
from app.commands.support.open_with_progress import opened_recording
from app.commands.support.options import PipelineOptions
from pipeline.alignment.projection import corrected
from pipeline.common.errors import BadInput
from pipeline.formats.calibration_files import FORMATS
from pipeline.types import CameraCalibration


@dataclass(frozen=True)
class ConvertCalibration:
    """Check the calibration of a recording or of a file, and write it for KITTI, ROS, OpenCV or Kalibr, or as a rig
    file.

    Example: cipv calibration astyx:PATH --params alignment.yaml --to ros --out front_camera
    """

    origin: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """A recording, or with --format a file; for ROS, the folder with camera_info.yaml and static_transform.yaml;
    for Kalibr, the folder with camchain.yaml and transform.yaml"""
    out: Path
    """File to write; for ROS and Kalibr, a folder"""
    format: Annotated[Literal["kitti", "ros", "opencv", "kalibr"] | None, option("kitti|ros|opencv|kalibr")] = None
    """Format of the file to read. Without it, SOURCE is a recording"""
    to: Literal["kitti", "ros", "opencv", "kalibr", "rig"] = "rig"
    """Format to write"""
    size: Annotated[tuple[int, int] | None, option("WIDTH HEIGHT")] = None
    """Image size, for formats that do not store it: KITTI"""
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)

    def __call__(self) -> int:
        camera = corrected(self.pipeline.parameters().alignment, self._read())
        FORMATS[self.to].write(self.out, camera)
        print(f"{self.out}: {self.to}, {camera.width}×{camera.height}, f = {camera.K[0, 0]:.1f} px")
        return 0

    def _read(self) -> CameraCalibration:
        if self.format is not None:
            read = FORMATS[self.format].read
            assert read is not None
            return read(Path(self.origin), self.size)
        camera = opened_recording(self.origin).frame(0).camera
        if camera is None:
            raise BadInput(f"{self.origin}: the recording has no camera calibration")
        return camera
