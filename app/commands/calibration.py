"""`cipv calibration`: read a camera calibration, check it, and write it in another format."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro
import yaml
from rich.console import Console
from rich.table import Table

from app.commands.support.arguments import option
from app.commands.support.open_with_progress import opened_recording
from app.commands.support.options import PipelineOptions
from pipeline.alignment.convert import angular_of, angular_values, calibration_in_use, costs
from pipeline.alignment.projection import Alignment, Pinhole, resolve
from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import write_new
from pipeline.formats.calibration_files import FORMATS, write_calibration
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import lidar_frame


@dataclass(frozen=True)
class ConvertCalibration:
    """Check the calibration of a recording or of a file, and write it for KITTI, ROS, OpenCV or Kalibr, as a rig file,
    or as the best fit of the angular model. With an angular alignment in --params, its best pinhole camera is written.

    Example: cipv calibration astyx:PATH --params alignment.yaml --to ros --out front_camera
    """

    origin: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """A recording, or with --format a file; for ROS, the folder with camera_info.yaml and static_transform.yaml; for
    Kalibr, the folder with camchain.yaml and transform.yaml; for KITTI's raw data, the folder of a day"""
    out: Path
    """File to write; must not exist. For ROS and Kalibr, the folder for their files"""
    format: Annotated[Literal["kitti", "ros", "opencv", "kalibr"] | None, option("kitti|ros|opencv|kalibr")] = None
    """Format of the file to read. Without it, SOURCE is a recording"""
    to: Literal["kitti", "ros", "opencv", "kalibr", "rig", "angular"] = "rig"
    """Format to write; angular: a preset file for `cipv run --params`, and a table of what this model costs"""
    size: Annotated[tuple[int, int] | None, option("WIDTH HEIGHT")] = None
    """Image size, for formats that do not store it: KITTI"""
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)

    def __call__(self) -> int:
        params = self.pipeline.parameters().alignment
        given, size, T_ego_lidar = self._read()
        camera = calibration_in_use(params, given, size)
        if params.model == "angular":
            aligned = resolve(params, given)
            assert aligned is not None
            self._say_cost(aligned, _pinhole(camera), camera)
        if self.to == "angular":
            found = angular_of(_pinhole(camera), camera)
            self._say_cost(_pinhole(camera), found, camera)
            write_new(self.out, yaml.safe_dump({"alignment": angular_values(found)}, sort_keys=False))
        else:
            write_calibration(self.out, self.to, camera, T_ego_lidar)
        print(f"{self.out}: {self.to}, {camera.width}×{camera.height}, f = {camera.K[0, 0]:.1f} px")
        return 0

    def _say_cost(self, aligned: Alignment, converted: Alignment, camera: CameraCalibration) -> None:
        table = Table("bearing", "image", "plan", title="mean error of the conversion, 10–60 m")
        for each in costs(aligned, converted, camera.width, camera.height, camera.road_z_m):
            table.add_row(f"{each.from_deg:.0f}–{each.to_deg:.0f}°", f"{each.mean_px:.1f} px", f"{each.mean_m:.2f} m")
        Console().print(table)

    def _read(self) -> tuple[CameraCalibration | None, tuple[int, int], F64 | None]:
        """The calibration, width and height of the images, and the LiDAR's mount."""
        if self.format is not None:
            camera = FORMATS[self.format].read(Path(self.origin), self.size)
            return camera, (camera.width, camera.height), None
        source = opened_recording(self.origin)
        frame = source.frame(0)
        mount = lidar_frame(source)
        if frame.camera is not None:
            return frame.camera, (frame.camera.width, frame.camera.height), mount
        size = self.size or frame.image_size
        if size is None:
            raise BadInput(f"{self.origin}: the recording has neither a camera calibration nor images")
        return None, size, mount


def _pinhole(camera: CameraCalibration) -> Pinhole:
    return Pinhole(camera.K, camera.distortion, camera.T_camera_ego)
