"""The one file that says which sensors a car has, where they sit and how they are reached. Unknown keys are refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from pipeline.common.geometry import inverse, rotation
from pipeline.common.user_file_errors import first_complaint, given_path, parse_yaml
from pipeline.common.user_files import LARGEST_TEXT_BYTES, read_regular
from pipeline.formats.file_reading import check_looks_ahead
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

Port = Annotated[int, Field(ge=1, le=65535)]
Metres = Annotated[float, Field(ge=-20.0, le=20.0)]
Degrees = Annotated[float, Field(ge=-180.0, le=180.0)]
Host = Annotated[str, Field(pattern=r"^\d{1,3}(\.\d{1,3}){3}$")]
OffsetMs = Annotated[float, Field(ge=-2000.0, le=2000.0)]


def _is_device(given: object) -> object:
    """A camera's number or path."""
    is_number = isinstance(given, int) and not isinstance(given, bool) and 0 <= given < _DEVICES
    if is_number or (isinstance(given, str) and _DEVICE_PATH.fullmatch(given)):
        return given
    raise ValueError(f"0 to {_DEVICES - 1}, or a path such as /dev/v4l/by-id/…")


_SUFFIXES = (".yaml", ".yml")
_DEVICES, _DEVICE_PATH = 64, re.compile(r"/dev/[^\s\0]+")
Device = Annotated[int | str, BeforeValidator(_is_device)]


class Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Mount(Strict):
    """Where a sensor sits in the ego frame (x forward, y left, z up, from the LiDAR) and how it is turned: roll and
    pitch as the sensor sits, positive pitch looks down, positive yaw looks left."""

    x_m: Metres = 0.0
    y_m: Metres = 0.0
    z_m: Metres = 0.0
    roll_deg: Degrees = 0.0
    pitch_deg: Degrees = 0.0
    yaw_deg: Degrees = 0.0

    def T_ego_sensor(self) -> F64:
        """(4, 4), axes of the sensor x forward, y left, z up."""
        T = np.eye(4)
        T[:3, :3] = rotation(*np.radians([self.roll_deg, self.pitch_deg, self.yaw_deg]))
        T[:3, 3] = self.x_m, self.y_m, self.z_m
        return T


class LidarConfig(Strict):
    """A Velodyne on the network. interface: address of the network card to listen on; 0.0.0.0 is all of them. sender:
    the sensor's address; None for the first that sends packets of a VLP-16."""

    model: Literal["VLP-16"] = "VLP-16"
    data_port: Port = 2368
    position_port: Port | None = 8308
    interface: str = "0.0.0.0"
    sender: Host | None = None
    multicast_group: str | None = None
    time_offset_ms: OffsetMs = 0.0
    mount: Mount = Mount()


class CalibrationConfig(Strict):
    """Pinhole camera with OpenCV distortion; ``mount`` has the optical axis along x."""

    fx_px: float = Field(gt=1.0, le=1e5)
    fy_px: float = Field(gt=1.0, le=1e5)
    cx_px: float = Field(ge=-1e5, le=1e5)
    cy_px: float = Field(ge=-1e5, le=1e5)
    width_px: int = Field(ge=16, le=16384)
    height_px: int = Field(ge=16, le=16384)
    distortion: tuple[float, ...] = ()
    mount: Mount = Mount()

    @model_validator(mode="after")
    def _check(self) -> CalibrationConfig:
        if len(self.distortion) not in (0, 4, 5, 8):
            raise ValueError("distortion: 0, 4, 5 or 8 numbers, in OpenCV's order")
        return self

    def calibration(self) -> CameraCalibration:
        K = np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])
        T_camera_mount = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
        T = T_camera_mount @ inverse(self.mount.T_ego_sensor())
        return CameraCalibration(K, np.array(self.distortion), T, self.width_px, self.height_px)


class CameraConfig(Strict):
    """Exactly one of device (its number or path), url (rtsp:// or http://, MJPEG too) and file (a video, played in a
    loop)."""

    device: Device | None = None
    url: str | None = Field(default=None, pattern=r"^(rtsp|rtsps|http|https)://\S+$")
    file: Path | None = None
    time_offset_ms: OffsetMs = 0.0
    calibration: CalibrationConfig | None = None

    @model_validator(mode="after")
    def _check(self) -> CameraConfig:
        _exactly_one(self, "device", "url", "file")
        return self


class GnssConfig(Strict):
    """A receiver's NMEA sentences: exactly one of serial (its device), tcp (host:port to connect to), udp_port (to
    listen on). interface, sender: of the UDP port, as of the LiDAR."""

    serial: str | None = None
    baud: Annotated[int, Field(ge=1200, le=4_000_000)] = 115_200
    tcp: str | None = Field(default=None, pattern=r"^.+:\d{1,5}$")
    udp_port: Port | None = None
    interface: str = "0.0.0.0"
    sender: Host | None = None
    time_offset_ms: OffsetMs = 0.0

    @model_validator(mode="after")
    def _check(self) -> GnssConfig:
        _exactly_one(self, "serial", "tcp", "udp_port")
        return self


class SignalConfig(Strict):
    """One signal of a DBC file, and what to multiply it with to get m/s or rad/s (turning left positive)."""

    message: str
    signal: str
    factor: float = 1.0


class CanConfig(Strict):
    """python-can's interface and channel, and which signals of the DBC file are speed and yaw rate."""

    interface: str = "socketcan"
    channel: str = "can0"
    bitrate: int | None = None
    dbc: Path
    speed_mps: SignalConfig
    yaw_rate_radps: SignalConfig | None = None


class EgoConfig(Strict):
    """Own speed and yaw rate: from the GNSS receiver, or from CAN."""

    source: Literal["gnss", "can"] = "gnss"
    can: CanConfig | None = None
    time_offset_ms: OffsetMs = 0.0

    @model_validator(mode="after")
    def _check(self) -> EgoConfig:
        if (self.source == "can") != (self.can is not None):
            raise ValueError("`source: can` needs `can:` with its DBC file; any other source must not have it")
        return self


class LiveConfig(Strict):
    """A car's sensors. Each may be left out, but not both LiDAR and camera."""

    title: str = "live"
    lidar: LidarConfig | None = None
    camera: CameraConfig | None = None
    gnss: GnssConfig | None = None
    ego: EgoConfig | None = None

    @model_validator(mode="after")
    def _check(self) -> LiveConfig:
        if self.lidar is None and self.camera is None:
            raise ValueError("neither lidar nor camera: at least one is needed")
        if self.ego is not None and self.ego.source == "gnss" and self.gnss is None:
            raise ValueError("ego takes its speed from gnss, but there is no gnss")
        return self


def load(path: str) -> LiveConfig:
    """The file's content; paths in it are relative to it. SourceError in one sentence when it cannot be used."""
    try:
        file = Path(path).expanduser()
        if file.suffix.lower() not in _SUFFIXES:
            raise ValueError
        text = read_regular(file, LARGEST_TEXT_BYTES).decode("utf-8")
    except (OSError, UnicodeDecodeError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a text file that ends in .yaml"
        raise SourceError(f"{path or 'live:'}: {reason}; `cipv live init` writes such a file") from None
    data = parse_yaml(text, path, SourceError)
    if not isinstance(data, dict):
        raise SourceError(f"{path}: expected sensors with their settings below them")
    try:
        config = _resolved(LiveConfig.model_validate(data), file.resolve().parent)
    except ValidationError as error:
        raise SourceError(f"{path}: {first_complaint(error, LiveConfig)}") from None
    except RecursionError:
        raise SourceError(f"{path}: nested too deeply") from None
    if config.camera is not None and config.camera.calibration is not None:
        check_looks_ahead(config.camera.calibration.calibration(), path)
    return config


def _resolved(config: LiveConfig, folder: Path) -> LiveConfig:
    """Paths taken from the file's own folder."""
    camera, ego = config.camera, config.ego
    if camera is not None and camera.file is not None:
        camera = camera.model_copy(update={"file": folder / given_path(camera.file, SourceError)})
    if ego is not None and ego.can is not None:
        dbc = folder / given_path(ego.can.dbc, SourceError)
        ego = ego.model_copy(update={"can": ego.can.model_copy(update={"dbc": dbc})})
    return config.model_copy(update={"camera": camera, "ego": ego})


def _exactly_one(config: BaseModel, *names: str) -> None:
    given = [name for name in names if getattr(config, name) is not None]
    if len(given) != 1:
        raise ValueError(
            f"give exactly one of {', '.join(names)}" + (f"; there are {', '.join(given)}" if given else "")
        )
