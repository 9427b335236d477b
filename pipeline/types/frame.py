"""What sensors deliver: one ``Frame`` a tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from pipeline.types.arrays import F32, F64, I32, U8


@dataclass(frozen=True)
class Sweep:
    """One LiDAR rotation.

    points: (N, 4) float32 ``x y z intensity`` in the ego frame, C-contiguous, finite.
    ring: (N,) uint8, the channel, 0 = lowest beam.
    time_s: (N,) float32, when each point was measured, seconds after ``t_ns``; null where the recording does not say.
    origin: ego x y z of the sensor, where its rays start.
    """

    t_ns: int
    points: F32
    ring: U8
    channels: int
    time_s: F32 | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Picture:
    """One camera image. t_ns: the camera's own stamp, null where the recording has none. bgr: (H, W, 3) uint8.
    ``encoded`` is the file as the camera gave it (JPEG), if it did."""

    t_ns: int | None
    bgr: U8
    encoded: bytes | None = None


@dataclass(frozen=True)
class CameraCalibration:
    """Pinhole camera with OpenCV distortion.

    K: (3, 3). distortion: (0,), (4,), (5,) or (8,) OpenCV order, of the raw image. T_camera_ego: (4, 4) takes
    ego points to the camera frame (z along the optical axis, x right, y down). road_z_m: the road below the car in the
    ego frame; null where the recording does not know it.
    """

    K: F64
    distortion: F64
    T_camera_ego: F64
    width: int
    height: int
    road_z_m: float | None = None


@dataclass(frozen=True)
class Coasting:
    """Of an own motion that is not measured any more. age_s: for how long. The others are what this tick adds to the
    variances of the way driven, the heading and the yaw rate."""

    age_s: float
    travelled_var_m2: float
    turned_var_rad2: float
    rate_var_rad2ps2: float


@dataclass(frozen=True)
class EgoState:
    """Own motion. ``yaw_rate_radps`` is positive to the left; null when no sensor gives it. coasting: null while it is
    measured."""

    t_ns: int
    speed_mps: float
    yaw_rate_radps: float | None = None
    coasting: Coasting | None = None


GnssQuality = Literal["single", "dgnss", "rtk_float", "rtk_fixed"]


@dataclass(frozen=True)
class GnssFix:
    """Where the ego origin is on the Earth (WGS 84). alt_m: above the ellipsoid. course_rad: which way it moves,
    clockwise from true north; null when it stands. sigma_m: standard deviation of the place, each way."""

    t_ns: int
    lat_deg: float
    lon_deg: float
    alt_m: float
    course_rad: float | None
    speed_mps: float
    quality: GnssQuality
    sigma_m: float


@dataclass(frozen=True)
class DistanceLaw:
    """What the height of a detector's boxes tells of distance: depth in metres = coefficient · height ^ exponent, of a
    car, the height in pixels as a camera of ``focal_px`` sees it. The ratios are heights of other classes, in cars.

    How tight a network draws its boxes, and how tall the vehicles are that it meets, are in these numbers, so each
    detector has its own.
    """

    coefficient: float
    exponent: float
    focal_px: float
    truck_ratio: float
    bus_ratio: float
    motorcycle_ratio: float

    def at_focal(self, focal_px: float) -> DistanceLaw:
        """The same law for heights as a camera of another focal length sees them."""
        factor = (self.focal_px / focal_px) ** self.exponent
        return replace(self, coefficient=self.coefficient * factor, focal_px=focal_px)


REAL_VEHICLES = DistanceLaw(1444.0, -1.0, 907.0, truck_ratio=1.6, bus_ratio=2.0, motorcycle_ratio=0.75)
"""The law of a detector that has none of its own: fitted by ``pipeline.calibration.distance`` to what YOLOX boxes of 38
labelled cars of two real cameras (Astyx 047–051 and 057–059, KITTI 2011_09_26 drive 0052), 1.59 m tall. 907 px is 720p
with a 78° diagonal. A motorcycle is boxed without its rider."""


@dataclass(frozen=True)
class RawBoxes:
    """A detector's candidates above a low floor, before thresholds and non-maximum suppression.

    Thresholds are parameters of the line, the network is not: this is what is cached per image and model.
    boxes: (M, 4) float32 ``x1 y1 x2 y2`` pixels of the raw image. scores: (M,) float32. labels: M class names.
    law: what the boxes' heights tell of distance, where no parameter says otherwise.
    """

    model: str
    boxes: F32
    scores: F32
    labels: tuple[str, ...]
    law: DistanceLaw = REAL_VEHICLES


@dataclass(frozen=True)
class RawLanes:
    """What a lane detector saw in one picture, before any geometry: like ``RawBoxes`` it is cached per image and model.

    points: (M, 2) float32 ``u v``, pixels of the raw image, on painted lines. scores: (M,) float32, 0–1.
    line: (M,) int32, which line a point belongs to, −1 where the detector does not group its points.
    """

    model: str
    points: F32
    scores: F32
    line: I32


@dataclass(frozen=True)
class Route:
    """A road driven or planned before, as a line on the Earth (WGS 84), in driving order.

    lat_deg, lon_deg: (K,) float64. sigma_m: standard deviation of each point, each way.
    """

    name: str
    lat_deg: F64
    lon_deg: F64
    sigma_m: float


@dataclass(frozen=True)
class StreamHealth:
    """How one live sensor does. rate_hz and jitter_ms: over the last seconds, null until enough came. age_ms: of
    its newest message, against now. lost: messages known to be missing since the start. note: what a person can do."""

    sensor: Literal["lidar", "camera", "gnss", "ego"]
    state: Literal["ok", "stale", "silent", "absent"]
    rate_hz: float | None
    age_ms: float | None
    jitter_ms: float | None
    lost: int
    note: str = ""


@dataclass(frozen=True)
class Frame:
    """Everything known at one tick. Any branch may be missing; ``notes`` says why, in words a person can act on.
    ``timing_ms``: of a live source, how long what it holds was under way, by stage. ``detections_given``: what is seen
    in the picture came with the frame; no detector is to look at it."""

    index: int
    name: str
    t_ns: int
    sweep: Sweep | None = None
    picture: Picture | None = None
    camera: CameraCalibration | None = None
    ego: EgoState | None = None
    raw_boxes: RawBoxes | None = None
    notes: tuple[str, ...] = ()
    gnss: GnssFix | None = None
    raw_lanes: RawLanes | None = None
    route: Route | None = None
    streams: tuple[StreamHealth, ...] = ()
    timing_ms: Mapping[str, float] = field(default_factory=dict)
    detections_given: bool = False

    @property
    def picture_size(self) -> tuple[int, int] | None:
        """(width, height) of the picture, or of the calibration where the picture itself is missing."""
        if self.picture is not None:
            return self.picture.bgr.shape[1], self.picture.bgr.shape[0]
        return (self.camera.width, self.camera.height) if self.camera is not None else None
