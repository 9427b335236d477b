"""The rig file: a small YAML file next to a recording of bare sensors, with the same keys as the live configuration. It
gives the mounts of the sensors, the camera's calibration, and the offsets of their clocks."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from pipeline.common.files.user_file_errors import first_complaint, read_yaml
from pipeline.formats.file_reading import check_looks_ahead
from pipeline.sources.live.config import CalibrationConfig, ConfigPart, Mount, OffsetMs
from pipeline.types import CameraCalibration, CameraImage
from pipeline.types.source import SourceError

SUFFIXES = (".yaml", ".yml")


class RigLidar(ConfigPart):
    """The LiDAR of a recording."""

    mount: Mount = Mount()
    """In the ego frame."""


class RigCamera(ConfigPart):
    """The camera of a recording."""

    calibration: CalibrationConfig | None = None
    """None if it is not known."""
    time_offset_ms: OffsetMs = 0.0
    """Added to the times of images."""


class RigGnss(ConfigPart):
    """The receiver of a recording."""

    time_offset_ms: OffsetMs = 0.0
    """Added to the times of fixes."""


class Rig(ConfigPart):
    """Offsets are added to the sensors' own times, as in the live configuration."""

    lidar: RigLidar = RigLidar()
    """Where it sits."""
    camera: RigCamera = RigCamera()
    """Calibration and clock."""
    gnss: RigGnss = RigGnss()
    """Clock."""

    def camera_calibration(self) -> CameraCalibration | None:
        calibration = self.camera.calibration
        return calibration.calibration() if calibration is not None else None


def load_rig(path: Path) -> Rig:
    """The content of the file. SourceError in one sentence if it cannot be used."""
    try:
        rig = Rig.model_validate(read_yaml(path, path.name, SourceError) or {})
    except ValidationError as error:
        raise SourceError(f"{path.name}: {first_complaint(error, Rig)}") from None
    camera = rig.camera_calibration()
    if camera is not None:
        check_looks_ahead(camera, path.name)
    return rig


def rig_in_folder(folder: Path, options: dict[str, str]) -> Path | None:
    """The rig file of a recording that is a folder: the option ``rig``, else ``rig.yaml``; None without one.
    SourceError if the file in the option is missing."""
    path = folder / options.get("rig", "rig.yaml")
    if path.is_file():
        return path
    if "rig" in options:
        raise SourceError(f"rig={options['rig']}: no such file")
    return None


def calibration_for(
    camera: CameraCalibration | None, image: CameraImage | None, notes: list[str]
) -> CameraCalibration | None:
    """The calibration if it has the image's size; else None, with a note in ``notes``."""
    if camera is None or image is None:
        return camera
    height, width = image.bgr.shape[:2]
    if (width, height) == (camera.width, camera.height):
        return camera
    notes.append(
        f"images are {width}×{height}, but the calibration is for {camera.width}×{camera.height}: calibration not used"
    )
    return None
