"""Sensor data: one ``Frame`` per tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from pipeline.types.arrays import F32, F64, U8
from pipeline.types.detections import RawBoxes, RawLanes


@dataclass(frozen=True)
class Sweep:
    """One LiDAR rotation."""

    t_ns: int
    """The sweep's own timestamp."""
    points: F32
    """(N, 4) float32 ``x y z intensity`` in the ego frame, C-contiguous, finite."""
    ring: U8
    """(N,) uint8, the channel, 0 = lowest beam."""
    channels: int
    """How many channels the sensor has."""
    time_s: F32 | None = None
    """(N,) float32, when each point was measured, seconds after ``t_ns``; None where the recording does not say."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Ego x y z of the sensor, where its rays start."""

    def __post_init__(self) -> None:
        """Copies read-only arrays, such as those in a file's bytes: for numba they are another type, and every kernel
        would be compiled for both."""
        for name in ("points", "ring", "time_s"):
            array = getattr(self, name)
            if array is not None and not array.flags.writeable:
                object.__setattr__(self, name, array.copy())


@dataclass(frozen=True)
class RangeScan:
    """The detections of one tick by a ranging sensor other than the LiDAR, such as a radar."""

    t_ns: int
    """When it was measured."""
    points: F32
    """(N, 3) float32 ``x y z`` of each detection in the ego frame, finite."""
    values: Mapping[str, F32] = field(default_factory=dict)
    """(N,) float32 each, finite: what else the sensor measures of each detection, by name with unit, for example
    ``range_rate_mps``."""


@dataclass(frozen=True)
class CameraImage:
    """One camera image."""

    t_ns: int | None
    """The camera's own timestamp; None where the recording has none."""
    bgr: U8
    """(H, W, 3) uint8."""
    encoded: bytes | None = None
    """The JPEG file, if the camera sent one."""


@dataclass(frozen=True)
class CameraCalibration:
    """Pinhole camera with OpenCV distortion."""

    K: F64
    """(3, 3) intrinsic matrix, pixels."""
    distortion: F64
    """(0,), (4,), (5,) or (8,) coefficients in OpenCV's order, for the raw image."""
    T_camera_ego: F64
    """(4, 4), takes ego points to the camera frame (z along the optical axis, x right, y down)."""
    width: int
    """Of the image, pixels."""
    height: int
    """Of the image, pixels."""
    road_z_m: float | None = None
    """Height of the road below the car in the ego frame; None where the recording does not contain it."""


@dataclass(frozen=True)
class Coasting:
    """Extra uncertainty of an own motion that is predicted because it is no longer measured."""

    age_s: float
    """Time since the last measurement."""
    travelled_var_m2: float
    """What this tick adds to the variance of the distance driven."""
    turned_var_rad2: float
    """What this tick adds to the variance of the heading."""
    rate_var_rad2ps2: float
    """What this tick adds to the variance of the yaw rate."""


MotionSource = Literal["can", "ins", "gnss", "lidar"]
"""Where own motion is measured: the vehicle bus or wheel odometry, an inertial unit, a GNSS receiver, the LiDAR."""


@dataclass(frozen=True)
class EgoState:
    """Own motion."""

    t_ns: int
    """When it was measured."""
    speed_mps: float
    """Positive forwards."""
    yaw_rate_radps: float | None = None
    """Positive to the left; None when no sensor gives it."""
    coasting: Coasting | None = None
    """Set while own motion is predicted; None while it is measured."""
    source: MotionSource = "can"
    """What measured it."""
    yaw_rate_sigma_radps: float | None = None
    """Standard deviation of the yaw rate; None for the default of usual sensors."""


@dataclass(frozen=True)
class MotionEstimate:
    """Own motion according to one source."""

    source: MotionSource
    """Which one."""
    speed_mps: float
    """Positive forwards."""
    speed_sigma_mps: float
    """Standard deviation of the speed."""
    yaw_rate_radps: float | None
    """Positive to the left; None where the source has none."""
    yaw_rate_sigma_radps: float | None
    """Standard deviation of the yaw rate."""


@dataclass(frozen=True)
class OwnMotion:
    """The most certain sources of speed and yaw rate."""

    speed: MotionEstimate
    """The source that gives the speed."""
    turning: MotionEstimate | None
    """The source that gives the yaw rate; None where none does."""
    sources: tuple[MotionEstimate, ...]
    """Every source used in this frame."""
    pose: tuple[float, float, float] | None = None
    """x, y in metres and heading in radians since LiDAR odometry started, in the ego frame of that moment; None without
    LiDAR odometry."""


GnssQuality = Literal["single", "dgnss", "rtk_float", "rtk_fixed"]


SLOWEST_COURSE_MPS = 0.5
"""Below this speed, a course is noise of the receiver."""


@dataclass(frozen=True)
class GnssFix:
    """Position of the ego origin on the Earth (WGS 84)."""

    t_ns: int
    """When the fix holds."""
    lat_deg: float
    """Positive to the north."""
    lon_deg: float
    """Positive to the east."""
    alt_m: float
    """Above the ellipsoid."""
    course_rad: float | None
    """Direction of motion, clockwise from true north; None at standstill."""
    speed_mps: float
    """Speed over ground."""
    quality: GnssQuality
    """How the fix was computed."""
    sigma_m: float
    """Standard deviation of the position along each horizontal axis."""


@dataclass(frozen=True)
class Route:
    """A planned or previously driven route as a line on the Earth (WGS 84), in driving order."""

    name: str
    """For people: the file it came from."""
    lat_deg: F64
    """(K,) float64."""
    lon_deg: F64
    """(K,) float64."""
    sigma_m: float
    """Standard deviation of each point along each horizontal axis."""


@dataclass(frozen=True)
class StreamHealth:
    """Whether one live sensor delivers, and how regularly."""

    sensor: Literal["lidar", "camera", "gnss", "ego"]
    """Which sensor."""
    state: Literal["ok", "stale", "silent", "absent"]
    """``absent``: nothing has arrived since the start. ``stale``: messages are overdue. ``silent``: overdue for long.
    """
    rate_hz: float | None
    """Over the last seconds; None until enough messages arrived."""
    age_ms: float | None
    """Age of the newest message."""
    jitter_ms: float | None
    """Over the last seconds; None until enough messages arrived."""
    lost: int
    """Messages known to be missing since the start."""
    note: str = ""
    """What a user can do about it."""


@dataclass(frozen=True)
class Frame:
    """Everything known at one tick. Any branch may be missing; ``notes`` says why."""

    index: int
    """Its number in the recording, from 0; for live sensors the number of the tick, including dropped ticks."""
    name: str
    """The frame's name in the recording."""
    t_ns: int
    """The tick."""
    sweep: Sweep | None = None
    """The LiDAR's rotation."""
    image: CameraImage | None = None
    """The camera's image."""
    camera: CameraCalibration | None = None
    """The camera's calibration; known without an image too."""
    ego: EgoState | None = None
    """Own motion as measured."""
    raw_boxes: RawBoxes | None = None
    """The detector's candidates; None if no detector ran."""
    notes: tuple[str, ...] = ()
    """What is missing or wrong, in sentences a user can act on."""
    gnss: GnssFix | None = None
    """Where the car is on the Earth."""
    raw_lanes: RawLanes | None = None
    """The lane detector's points; None if no lane detector ran."""
    route: Route | None = None
    """The route that the car follows."""
    streams: tuple[StreamHealth, ...] = ()
    """Health of each sensor of a live source."""
    timing_ms: Mapping[str, float] = field(default_factory=dict)
    """Of a live source: latency of its data, by stage."""
    detections_given: bool = False
    """The recording contains detections, so no detector runs."""
    scans: Mapping[str, RangeScan] = field(default_factory=dict)
    """Of further ranging sensors, by ``SensorKind.name``."""

    @property
    def image_size(self) -> tuple[int, int] | None:
        """(width, height) of the image, or of the calibration where the image itself is missing."""
        if self.image is not None:
            return self.image.bgr.shape[1], self.image.bgr.shape[0]
        return (self.camera.width, self.camera.height) if self.camera is not None else None
