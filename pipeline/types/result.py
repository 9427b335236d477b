"""The output of the pipeline for one tick."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pipeline.types.arrays import F32, F64, I32, Box, PixelWindow
from pipeline.types.frame import EgoState, Frame, OwnMotion, StreamHealth
from pipeline.types.lane import EgoLane
from pipeline.types.measurements import Ground, Obstacle
from pipeline.types.objects import FusedObject, LidarTrack, VisionTrack

PathSource = Literal["lane", "gnss", "yaw_rate", "straight", "edges", "traffic", "drivable_area", "fused"]


@dataclass(frozen=True)
class Path:
    """Where the car is going."""

    source: PathSource
    """The main source at 30 m; ``fused`` if no single source dominates there."""
    center: F64
    """(K, 2) float64 ego x, y, starting at the bumper."""
    left: F64
    """(K, 2) float64, the left edge; not necessarily parallel to the centre."""
    right: F64
    """(K, 2) float64, the right edge."""
    half_width_m: float
    """Half the corridor's width used where there are no lane lines."""
    sigma_m: dict[str, float]
    """Standard deviation of the centre's lateral position at 10, 30 and 60 m."""
    weights: dict[str, float]
    """Weight of each source, averaged over the whole length."""
    profile_m: F64 = field(default_factory=lambda: np.zeros(0))
    """(K,) float64, ``sigma_m`` at every point; empty where it was not computed."""
    corner_m: F64 = field(default_factory=lambda: np.zeros(0))
    """(K,) float64, the additional standard deviation at every point because the car may turn at a corner that nothing
    shows. It applies to what stands: a vehicle that drives ahead follows the road. Empty where it was not computed."""
    carried_by: dict[str, dict[str, float]] = field(default_factory=dict)
    """Weight of each source at 10, 30 and 60 m."""
    reach_m: float = 0.0
    """How far ahead the path is accurate enough to drive by."""
    usable: bool = True
    """Whether it reaches far enough at this speed and nothing else makes it unusable."""
    doubt: str = ""
    """Why it is not usable; empty while it is usable."""
    confidence: float = 1.0
    """Probability, 0–1, that the true centre lies within the corridor over the required length."""
    notes: tuple[str, ...] = ()
    """Problems with its sources, as sentences for the user."""


@dataclass(frozen=True)
class Cipv:
    """The closest in-path vehicle, and why it is this one."""

    id: int
    """Of the object."""
    distance_m: float
    """Of the object."""
    closing_speed_mps: float | None
    """How fast the gap shrinks; None if position or velocity is unknown."""
    ttc_s: float | None
    """Time to collision; None while the gap does not shrink."""
    reason: str
    """Why this object, in words."""
    accel_mps2: float | None = None
    """Its acceleration over ground along our line of sight, negative when it brakes; None until it is known well
    enough, and for the next CIPV."""
    accel_sigma_mps2: float | None = None
    """Standard deviation of that."""


@dataclass(frozen=True)
class Rejection:
    """Why an object is not the CIPV."""

    id: int
    """Of the object."""
    reason: str
    """The first condition that it fails, in words."""


@dataclass(frozen=True)
class AccCommand:
    """What ACC and emergency braking request from the car."""

    state: Literal["cruise", "follow", "stop", "warn", "partial_brake", "full_brake"]
    """What it does."""
    desired_speed_mps: float
    """The target speed."""
    accel_mps2: float
    """The requested acceleration; negative is braking."""
    accelerator: float
    """Pedal, 0–1."""
    brake: float
    """Pedal, 0–1."""
    reason: str
    """Why, in words."""
    object_id: int | None = None
    """The object that it brakes for; None without one."""


@dataclass(frozen=True)
class ScanHealth:
    """How fresh a further ranging sensor's data is."""

    age_ms: float
    """Age of the scan."""
    points: int
    """Detections in it."""


@dataclass(frozen=True)
class SensorHealth:
    """How fresh each sensor's data is. Ages are against the frame's tick; None when the sensor delivered nothing."""

    lidar_age_ms: float | None
    """Age of the sweep."""
    lidar_points: int | None
    """Points of the sweep."""
    camera_age_ms: float | None
    """Age of the image."""
    camera_skew_ms: float | None
    """How much later than the sweep the image was taken."""
    ego_age_ms: float | None
    """Age of own motion."""
    far_view: PixelWindow | None = None
    """The image region that the detector processed a second time, in native pixels; None without a second pass."""
    lanes_age_ms: float | None = None
    """How much older than the tick the image is in which lane lines were looked for, if they came with this frame: 0
    for the frame's own image."""
    lanes_far_view: PixelWindow | None = None
    """The only part of that image, in native pixels, in which they were looked for; None for the whole image."""
    scans: Mapping[str, ScanHealth] = field(default_factory=dict)
    """Of further ranging sensors that delivered, by ``SensorKind.name``."""

    @staticmethod
    def of(frame: Frame) -> SensorHealth:
        """Sensor health of a frame."""

        def age_ms(t_ns: int | None) -> float | None:
            return None if t_ns is None else (frame.t_ns - t_ns) / 1e6

        sweep, image = frame.sweep, frame.image
        image_ns = image.t_ns if image is not None else None
        return SensorHealth(
            lidar_age_ms=age_ms(sweep.t_ns if sweep is not None else None),
            lidar_points=len(sweep.points) if sweep is not None else None,
            camera_age_ms=age_ms(image_ns),
            camera_skew_ms=(image_ns - sweep.t_ns) / 1e6 if image_ns is not None and sweep is not None else None,
            ego_age_ms=age_ms(frame.ego.t_ns if frame.ego is not None else None),
            far_view=frame.raw_boxes.far if frame.raw_boxes is not None else None,
            lanes_age_ms=1e3 * frame.raw_lanes.age_s if frame.raw_lanes is not None else None,
            lanes_far_view=frame.raw_lanes.window if frame.raw_lanes is not None else None,
            scans={
                name: ScanHealth((frame.t_ns - scan.t_ns) / 1e6, len(scan.points)) for name, scan in frame.scans.items()
            },
        )


GROUND, UNCLUSTERED, DROPPED = -1, -2, -3
"""Values of ``Layers.kind`` below zero; other values are the index of the cluster."""


@dataclass(frozen=True)
class Layers:
    """Intermediate results of the stages, for views only; never part of the JSON."""

    points: F32
    """(N, 4) float32, the sweep before down-sampling."""
    kind: I32
    """(N,) int32: ``GROUND``, ``UNCLUSTERED``, ``DROPPED`` or the cluster's number (``Obstacle.cluster``)."""
    obstacles: tuple[Obstacle, ...] = ()
    """One per cluster."""
    lidar_tracks: tuple[LidarTrack, ...] = ()
    """By id."""
    vision_tracks: tuple[VisionTrack, ...] = ()
    """By id."""
    lidar_boxes: dict[int, Box] = field(default_factory=dict)
    """By object id: the LiDAR cuboid projected into the image by fusion."""
    vision_boxes: dict[int, Box] = field(default_factory=dict)
    """By object id: the camera box that fusion compared it with."""
    lanes: EgoLane | None = None
    """The ego lane's lines; None without a lane detector."""
    ground: Ground | None = None
    """The fitted road under the sweep; None without one."""
    edges: F64 | None = None
    """(M, 2) ego x, y of structures beside the road, if the path uses them; else None."""
    traffic: F64 | None = None
    """(N, 3) ego x, y and heading in rad of vehicles, current and past, that indicate the course of the road; None
    without."""
    drivable: F64 | None = None
    """(M, 2) ego x, y of the edges of the drivable area, if the path uses them; else None."""


@dataclass(frozen=True)
class Result:
    """The output of the pipeline for one tick. ``pipeline.types.result_json`` writes it as described in
    docs/reference/results.md."""

    frame: str
    """The frame's name in the recording."""
    t_ns: int
    """The tick."""
    sensors: SensorHealth
    """How fresh each sensor's data is."""
    ego: EgoState | None
    """Own motion from its most certain source."""
    objects: tuple[FusedObject, ...]
    """Every object, nearest first."""
    path: Path
    """Where the car is going."""
    cipv: Cipv | None
    """The closest in-path vehicle; None without one."""
    rejected: tuple[Rejection, ...]
    """Why each other object is not the CIPV."""
    acc: AccCommand | None
    """The command to the car; None while own speed is unknown."""
    notes: tuple[str, ...]
    """What is missing or wrong, in sentences a user can act on."""
    timing_ms: dict[str, float]
    """How long each stage took, and the ``total``."""
    layers: Layers
    """Intermediate results of the stages, for views."""
    next_cipv: Cipv | None = None
    """The vehicle that will be the CIPV next."""
    streams: tuple[StreamHealth, ...] = ()
    """Health of each sensor of a live source."""
    own_motion: OwnMotion | None = None
    """The sources of own motion; None if it is not measured."""

    def chosen(self) -> FusedObject | None:
        """The object that is the CIPV; None without one."""
        return next((item for item in self.objects if self.cipv is not None and item.id == self.cipv.id), None)
