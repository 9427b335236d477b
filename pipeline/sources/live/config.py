"""The configuration of live sensors: which sensors a car has, their mounts and connections. Unknown keys are
rejected."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from pipeline.common.files.user_file_errors import first_complaint, given_path, parse_yaml
from pipeline.common.files.user_files import LARGEST_TEXT_BYTES, read_regular
from pipeline.common.geometry import T_OPTICAL_BODY, inverse, rotation
from pipeline.formats.calibration_files.lens import LENGTHS
from pipeline.formats.file_reading import check_looks_ahead
from pipeline.types import F64, CameraCalibration
from pipeline.types.source import SourceError

Port = Annotated[int, Field(ge=1, le=65535)]
Metres = Annotated[float, Field(ge=-20.0, le=20.0)]


def _is_in_degrees(given: float) -> float:
    """ValueError for a usual angle in radians, to the four places that it is written with."""
    turned_deg = next((each for each in _USUAL_DEG if abs(abs(given) - math.radians(each)) <= _WRITTEN_RAD), None)
    if turned_deg is not None:
        text = f"{given:g} is {math.copysign(turned_deg, given):g}° in radians; the angles of a mount are in degrees"
        raise ValueError(text)
    return given


Degrees = Annotated[float, Field(ge=-180.0, le=180.0), AfterValidator(_is_in_degrees)]
Host = Annotated[str, Field(pattern=r"^\d{1,3}(\.\d{1,3}){3}$")]
OffsetMs = Annotated[float, Field(ge=-2000.0, le=2000.0)]


def _is_device(given: object) -> object:
    """A camera's number or path."""
    is_number = isinstance(given, int) and not isinstance(given, bool) and 0 <= given < _DEVICES
    if is_number or (isinstance(given, str) and _DEVICE_PATH.fullmatch(given)):
        return given
    raise ValueError(f"0 to {_DEVICES - 1}, or a path such as /dev/v4l/by-id/…")


_USUAL_DEG, _WRITTEN_RAD = (30.0, 45.0, 60.0, 90.0, 120.0, 135.0, 180.0), 0.5e-4
"""Angles by which sensors are turned on purpose, none of which is a number with three places in radians; and half the
fourth place. One in 4000 other angles between 0.5 and 3.2 degrees, with four places, looks like one of them."""
_SUFFIXES = (".yaml", ".yml")
_DEVICES, _DEVICE_PATH = 64, re.compile(r"/dev/[^\s\0]+")
Device = Annotated[int | str, BeforeValidator(_is_device)]


class ConfigPart(BaseModel):
    """A part of the sensor configuration: unknown keys and non-finite numbers are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Mount(ConfigPart):
    """Where a sensor sits in the ego frame (x forward, y left, z up, from the LiDAR) and how it is turned."""

    x_m: Metres = 0.0
    """Forward of the LiDAR."""
    y_m: Metres = 0.0
    """Left of the LiDAR."""
    z_m: Metres = 0.0
    """Above the LiDAR."""
    roll_deg: Degrees = 0.0
    """Positive leans right."""
    pitch_deg: Degrees = 0.0
    """Positive looks down."""
    yaw_deg: Degrees = 0.0
    """Positive looks left."""

    def T_ego_sensor(self) -> F64:
        """(4, 4), axes of the sensor x forward, y left, z up."""
        T = np.eye(4)
        T[:3, :3] = rotation(*np.radians([self.roll_deg, self.pitch_deg, self.yaw_deg]))
        T[:3, 3] = self.x_m, self.y_m, self.z_m
        return T


class LidarConfig(ConfigPart):
    """A Velodyne on the network."""

    model: Literal["VLP-16"] = "VLP-16"
    """The one that packets are decoded for."""
    data_port: Port = 2368
    """UDP port of the points."""
    position_port: Port | None = 8308
    """UDP port of time and NMEA; None does not listen."""
    interface: str = "0.0.0.0"
    """Address of the network card to listen on; 0.0.0.0 is all of them."""
    sender: Host | None = None
    """The sensor's address; None for the first that sends packets of a VLP-16."""
    multicast_group: str | None = None
    """Address to join; None for unicast or broadcast."""
    time_offset_ms: OffsetMs = 0.0
    """Added to the sensor's times."""
    mount: Mount = Mount()
    """In the car; the ego frame's origin is where the LiDAR should be."""


class CalibrationConfig(ConfigPart):
    """Pinhole camera with OpenCV distortion; ``mount`` has the optical axis along x."""

    fx_px: float = Field(gt=1.0, le=1e5)
    """Focal length along the rows."""
    fy_px: float = Field(gt=1.0, le=1e5)
    """Focal length along the columns."""
    cx_px: float = Field(ge=-1e5, le=1e5)
    """Column of the principal point."""
    cy_px: float = Field(ge=-1e5, le=1e5)
    """Row of the principal point."""
    width_px: int = Field(ge=16, le=16384)
    """Of the images that the numbers hold for."""
    height_px: int = Field(ge=16, le=16384)
    """Of the images that the numbers hold for."""
    distortion: tuple[float, ...] = ()
    """OpenCV's coefficients: 0, 4, 5 or 8."""
    mount: Mount = Mount()
    """Of the optical centre."""

    @model_validator(mode="after")
    def _check(self) -> CalibrationConfig:
        if len(self.distortion) not in (0, *LENGTHS):
            raise ValueError("distortion: 0, 4, 5 or 8 numbers, in OpenCV's order")
        return self

    def calibration(self) -> CameraCalibration:
        K = np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])
        T = T_OPTICAL_BODY @ inverse(self.mount.T_ego_sensor())
        return CameraCalibration(K, np.array(self.distortion), T, self.width_px, self.height_px)


class CameraConfig(ConfigPart):
    """One camera: exactly one of device, url and file."""

    device: Device | None = None
    """Number or path of a local camera."""
    url: str | None = Field(default=None, pattern=r"^(rtsp|rtsps|http|https)://\S+$")
    """rtsp:// or http://, MJPEG too."""
    file: Path | None = None
    """A video, played in a loop."""
    time_offset_ms: OffsetMs = 0.0
    """Added to the camera's times."""
    calibration: CalibrationConfig | None = None
    """Without it, LiDAR and camera are not fused."""

    @model_validator(mode="after")
    def _check(self) -> CameraConfig:
        _exactly_one(self, "device", "url", "file")
        return self


class GnssConfig(ConfigPart):
    """A receiver's NMEA sentences: exactly one of serial, tcp, udp_port."""

    serial: str | None = None
    """Its device, such as /dev/ttyUSB0."""
    baud: Annotated[int, Field(ge=1200, le=4_000_000)] = 115_200
    """Of the serial port."""
    tcp: str | None = Field(default=None, pattern=r"^.+:\d{1,5}$")
    """host:port to connect to."""
    udp_port: Port | None = None
    """To listen on."""
    interface: str = "0.0.0.0"
    """Address of the network card that the UDP port listens on; 0.0.0.0 is all of them."""
    sender: Host | None = None
    """Whose datagrams the UDP port takes; None for the first sender of NMEA."""
    time_offset_ms: OffsetMs = 0.0
    """Added to the receiver's times."""

    @model_validator(mode="after")
    def _check(self) -> GnssConfig:
        _exactly_one(self, "serial", "tcp", "udp_port")
        # a resolver would take the remainder of a larger number, another port
        if self.tcp is not None and not 0 < int(self.tcp.rpartition(":")[2]) < 1 << 16:
            raise ValueError(f"tcp: {self.tcp}: ports are 1 to 65535")
        return self


class SignalConfig(ConfigPart):
    """One signal of a DBC file."""

    message: str
    """Its message in the DBC file."""
    signal: str
    """Its name in that message."""
    factor: float = 1.0
    """What to multiply it with to get m/s, or rad/s with left turns positive."""


class CanConfig(ConfigPart):
    """python-can's interface and channel, and which signals of the DBC file are speed and yaw rate."""

    interface: str = "socketcan"
    """One of python-can's."""
    channel: str = "can0"
    """What the interface is called on this machine."""
    bitrate: int | None = None
    """Bits per second; None leaves it as it is set up."""
    dbc: Path
    """The file that describes the bus."""
    speed_mps: SignalConfig
    """Which signal is the ego speed."""
    yaw_rate_radps: SignalConfig | None = None
    """Which signal is the yaw rate; None where the bus has none."""


class EgoConfig(ConfigPart):
    """Ego speed and yaw rate."""

    source: Literal["gnss", "can"] = "gnss"
    """Whose speed is used."""
    can: CanConfig | None = None
    """Required when the source is ``can``."""
    time_offset_ms: OffsetMs = 0.0
    """Added to the source's times."""

    @model_validator(mode="after")
    def _check(self) -> EgoConfig:
        if (self.source == "can") != (self.can is not None):
            raise ValueError("`source: can` needs `can:` with its DBC file; any other source must not have it")
        return self


class LiveConfig(ConfigPart):
    """A car's sensors. Each may be left out, but not both LiDAR and camera."""

    title: str = "live"
    """Names sessions and the window."""
    lidar: LidarConfig | None = None
    """None for a car without one."""
    camera: CameraConfig | None = None
    """None for a car without one."""
    gnss: GnssConfig | None = None
    """None for a car without one."""
    ego: EgoConfig | None = None
    """None where neither receiver nor bus gives the ego speed."""

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
        file = given_path(path, SourceError)
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
