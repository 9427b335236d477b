"""What flows along the line: one ``Frame`` in, one ``Result`` out, and the values handed from stage to stage.

Frames of reference: the *ego frame* is x forward, y left, z up, metres, origin named by the source. The image is
u right, v down, pixels. Times are nanoseconds of the sensors' own clock. Every class is frozen; arrays inside are
treated as read-only. What a frame makes by the hundred is a named tuple, which costs a fraction of a data class.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.geometry import Cuboid
from pipeline.path.lane_types import EgoLane

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U8 = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]
Point2 = tuple[float, float]
Point3 = tuple[float, float, float]
Box = tuple[float, float, float, float]
"""Axis-aligned image box ``x1 y1 x2 y2`` in pixels."""
SourceKind = Literal["V", "L", "VL"]
"""Which sensor saw an object: vision only, LiDAR only, or both (paper, Table 3 "Name")."""

VEHICLES = frozenset({"car", "truck", "bus", "motorcycle"})
"""Class names that may be a lead vehicle. Detector labels are mapped to the COCO names by the detector."""


# ---------------------------------------------------------------- what sensors deliver


@dataclass(frozen=True)
class Sweep:
    """One LiDAR rotation.

    points: (N, 4) float32 ``x y z intensity`` in the ego frame, C-contiguous, finite.
    ring: (N,) uint8, the channel, 0 = lowest beam.
    time_s: (N,) float32, when each point was measured, seconds after ``t_ns``; null where the recording does not say.
    """

    t_ns: int
    points: F32
    ring: U8
    channels: int
    time_s: F32 | None = None


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
    ego points to the camera frame (z along the optical axis, x right, y down).
    """

    K: F64
    distortion: F64
    T_camera_ego: F64
    width: int
    height: int


@dataclass(frozen=True)
class EgoState:
    """Own motion. ``yaw_rate_radps`` is positive to the left; null when no sensor gives it."""

    t_ns: int
    speed_mps: float
    yaw_rate_radps: float | None = None


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
class RawBoxes:
    """A detector's candidates above a low floor, before thresholds and non-maximum suppression.

    Thresholds are parameters of the line, the network is not: this is what is cached per image and model.
    boxes: (M, 4) float32 ``x1 y1 x2 y2`` pixels of the raw image. scores: (M,) float32. labels: M class names.
    """

    model: str
    boxes: F32
    scores: F32
    labels: tuple[str, ...]


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
    ``timing_ms``: of a live source, how long what it holds was under way, by stage."""

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


# ---------------------------------------------------------------- what stages hand on


@dataclass(frozen=True)
class Ground:
    """The road under the sweep.

    mask: (N,) bool, kept points that are ground. planes: (S, 4) float64 ``nx ny nz d`` with n·p + d = 0, |n| = 1,
    n_z > 0; all NaN where no ground was found. edges: (S + 1,) float64, bounds of the segments along x in metres;
    the outer segments reach on beyond theirs. fitted: (S,) bool, false where the plane is a neighbour's.
    """

    mask: Mask
    planes: F64
    edges: F64
    fitted: Mask

    def height(self, xy: npt.NDArray[np.floating]) -> F64:
        """(M,) ground z in metres at (M, 2) ego places; NaN where no ground was found."""
        xy = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        plane = self.planes[self._segment(xy[:, 0])]
        return np.asarray(-(plane[:, 3] + plane[:, 0] * xy[:, 0] + plane[:, 1] * xy[:, 1]) / plane[:, 2])

    def above(self, points: npt.NDArray[np.floating]) -> F64:
        """(M,) height in metres of (M, 3+) ego points over the ground, along its normal; NaN without ground."""
        plane = self.planes[self._segment(points[:, 0])]
        return np.asarray(np.sum(plane[:, :3] * points[:, :3], axis=1) + plane[:, 3])

    def _segment(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.intp]:
        return np.searchsorted(self.edges[1:-1], x, side="right")


@dataclass(frozen=True)
class Detection:
    """One box after thresholds and suppression."""

    bbox: Box
    label: str
    score: float


@dataclass(frozen=True)
class VisionMeasurement:
    """A detection with its estimated place. ``distance_m`` is the horizontal range from the ego origin to the nearest
    face; it and ``position`` (ego x, y of that face's centre) are null where no law gives a distance."""

    detection: Detection
    distance_m: float | None
    sigma_m: float | None
    position: Point2 | None


class Obstacle(NamedTuple):
    """One LiDAR cluster. ``density`` is points per square metre of footprint (paper: "number, density and
    distribution"); ``spread`` the standard deviation of its points along x, y, z in metres."""

    cluster: int
    cuboid: Cuboid
    closest_point: Point3
    points: int
    density: float
    spread: Point3


class LidarTrack(NamedTuple):
    """An obstacle followed over time. ``velocity_mps`` is relative to ego (x, y); null until two sightings.
    ``obstacle`` is the last one seen, moved by the prediction while ``carried``; ``unseen_s`` says for how long."""

    id: int
    obstacle: Obstacle
    velocity_mps: Point2 | None
    hits: int
    missed: int
    carried: bool
    unseen_s: float = 0.0


@dataclass(frozen=True)
class VisionTrack:
    """A detected box followed over time. ``distance_m``/``sigma_m``/``position``/``velocity_mps`` are filtered;
    null where never measured. A carried box was not seen in this frame; ``measured`` says whether its distance was (a
    box that the picture's edge cuts is seen, but not measured)."""

    id: int
    bbox: Box
    label: str
    score: float
    distance_m: float | None
    sigma_m: float | None
    position: Point2 | None
    velocity_mps: Point2 | None
    hits: int
    missed: int
    carried: bool
    measured: bool = True


class Gate(NamedTuple):
    """One test an object went through, with its number and limit; ``value`` is null when there was nothing to test."""

    name: str
    value: float | None
    limit: float
    passed: bool


@dataclass(frozen=True)
class FusedObject:
    """The paper's Table 3 row, widened by what the contract asks for. Frames and units as in the contract.

    A V object whose distance nobody knows (no law for its class, box cut by the picture's edge, beyond the law's
    reach) keeps its row: its place and distance are null, and it cannot be the CIPV.

    source: which sensors' tracks it is made of. seen_by: which of them saw it in this frame; none: it is carried.
    measured: its distance was measured in this frame; else it is a prediction.
    lateral_mps: how fast it moves to the left of the path, over ground. crossing_s: until it is over the edge of it, or
    out of it where it is in; null when its sideways speed leads nowhere."""

    id: int
    source: SourceKind
    label: str | None
    score: float | None
    bbox: Box | None
    bev: tuple[Point2, Point2, Point2, Point2] | None
    cuboid: Cuboid | None
    closest_point: Point3 | None
    distance_m: float | None
    distance_sigma_m: float | None
    velocity_mps: Point2 | None
    seen_by: Literal["", "V", "L", "VL"]
    hits: int
    lidar_points: int
    lidar_track: int | None
    vision_track: int | None
    gates: tuple[Gate, ...] = ()
    speed_over_ground_mps: float | None = None
    moving: bool | None = None
    ttc_s: float | None = None
    in_path: bool = False
    in_path_probability: float | None = None
    path_offset_m: float | None = None
    measured: bool = True
    lateral_mps: float | None = None
    crossing_s: float | None = None

    @property
    def carried(self) -> bool:
        """Not seen in this frame: where it is now is a prediction."""
        return not self.seen_by


PathSource = Literal["lane", "gnss", "yaw_rate", "straight", "fused"]


@dataclass(frozen=True)
class Path:
    """Where the car is going. center, left, right: (K, 2) float64 ego x, y, from the bumper outwards; the edges need
    not be parallel to the centre. source: which one carries it at 30 m, or ``fused`` when none does alone. sigma_m: of
    the centre's sideways place at 10, 30, 60 m; profile_m: (K,) float64, the same at every point, empty where nobody
    worked it out. weights: each source's share over the whole; carried_by: at 10, 30, 60 m. reach_m: how far it is good
    enough to drive after. usable: that is far enough at this speed. confidence: 0–1, that the true centre lies within
    the corridor there. notes: what is wrong with the sources, for a person."""

    source: PathSource
    center: F64
    left: F64
    right: F64
    half_width_m: float
    sigma_m: dict[str, float]
    weights: dict[str, float]
    profile_m: F64 = field(default_factory=lambda: np.zeros(0))
    carried_by: dict[str, dict[str, float]] = field(default_factory=dict)
    reach_m: float = 0.0
    usable: bool = True
    confidence: float = 1.0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Cipv:
    """The closest in-path vehicle, and why it is this one."""

    id: int
    distance_m: float
    closing_speed_mps: float | None
    ttc_s: float | None
    reason: str


@dataclass(frozen=True)
class Rejection:
    """Why an object is not the CIPV."""

    id: int
    reason: str


@dataclass(frozen=True)
class AccCommand:
    """What the longitudinal controller asks for. accelerator and brake are 0–1."""

    state: Literal["cruise", "follow", "stop", "warn", "partial_brake", "full_brake"]
    desired_speed_mps: float
    accel_mps2: float
    accelerator: float
    brake: float
    reason: str


@dataclass(frozen=True)
class SensorHealth:
    """Ages are against the frame's tick, milliseconds; null when the sensor gave nothing in this frame."""

    lidar_age_ms: float | None
    lidar_points: int | None
    camera_age_ms: float | None
    camera_skew_ms: float | None
    ego_age_ms: float | None


GROUND, UNCLUSTERED, DROPPED = -1, -2, -3
"""Values of ``Layers.kind`` below zero; zero and above is the index of the cluster."""


@dataclass(frozen=True)
class Layers:
    """What the stages saw, for views only; never part of the JSON.

    points: (N, 4) float32, the sweep before down-sampling. kind: (N,) int32, ``GROUND``, ``UNCLUSTERED``,
    ``DROPPED`` or the cluster index (``Obstacle.cluster``). lidar_boxes / vision_boxes: the two boxes that fusion
    compared, by fused object id. lanes: the ego lane's lines, null where no lane detector runs.
    ground: the road under the sweep, null without one.
    """

    points: F32
    kind: I32
    obstacles: tuple[Obstacle, ...] = ()
    lidar_tracks: tuple[LidarTrack, ...] = ()
    vision_tracks: tuple[VisionTrack, ...] = ()
    lidar_boxes: dict[int, Box] = field(default_factory=dict)
    vision_boxes: dict[int, Box] = field(default_factory=dict)
    lanes: EgoLane | None = None
    ground: Ground | None = None


@dataclass(frozen=True)
class Result:
    """What the line believes at one tick. ``pipeline.results.to_json`` writes it in the contract's form."""

    frame: str
    t_ns: int
    sensors: SensorHealth
    ego: EgoState | None
    objects: tuple[FusedObject, ...]
    path: Path
    cipv: Cipv | None
    rejected: tuple[Rejection, ...]
    acc: AccCommand | None
    notes: tuple[str, ...]
    timing_ms: dict[str, float]
    layers: Layers
    next_cipv: Cipv | None = None
    streams: tuple[StreamHealth, ...] = ()
