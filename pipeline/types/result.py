"""What the line believes at one tick."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pipeline.types.arrays import F32, F64, I32, Box
from pipeline.types.frame import EgoState, Frame, StreamHealth
from pipeline.types.lane import EgoLane
from pipeline.types.objects import FusedObject, Ground, LidarTrack, Obstacle, VisionTrack

PathSource = Literal["lane", "gnss", "yaw_rate", "straight", "fused"]


@dataclass(frozen=True)
class Path:
    """Where the car is going. center, left, right: (K, 2) float64 ego x, y, from the bumper outwards; the edges need
    not be parallel to the centre. source: which one carries it at 30 m, or ``fused`` when none does alone. sigma_m: of
    the centre's sideways place at 10, 30, 60 m; profile_m: (K,) float64, the same at every point, empty where nobody
    worked it out. weights: each source's share over the whole; carried_by: at 10, 30, 60 m. reach_m: how far it is good
    enough to drive after. usable: that is far enough at this speed, and nothing speaks against it. doubt: else why not,
    in words. confidence: 0–1, that the true centre lies within the corridor there. notes:
    what is wrong with the sources, for a person."""

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
    doubt: str = ""
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
    """What the longitudinal controller asks for. accelerator and brake are 0–1. object_id: what it slows down for, null
    for nothing."""

    state: Literal["cruise", "follow", "stop", "warn", "partial_brake", "full_brake"]
    desired_speed_mps: float
    accel_mps2: float
    accelerator: float
    brake: float
    reason: str
    object_id: int | None = None


@dataclass(frozen=True)
class SensorHealth:
    """Ages are against the frame's tick, milliseconds; null when the sensor gave nothing in this frame."""

    lidar_age_ms: float | None
    lidar_points: int | None
    camera_age_ms: float | None
    camera_skew_ms: float | None
    ego_age_ms: float | None

    @staticmethod
    def of(frame: Frame) -> SensorHealth:
        """The health of the sensors that a frame came from."""

        def age_ms(t_ns: int | None) -> float | None:
            return None if t_ns is None else (frame.t_ns - t_ns) / 1e6

        sweep, picture = frame.sweep, frame.picture
        picture_ns = picture.t_ns if picture is not None else None
        return SensorHealth(
            lidar_age_ms=age_ms(sweep.t_ns if sweep is not None else None),
            lidar_points=len(sweep.points) if sweep is not None else None,
            camera_age_ms=age_ms(picture_ns),
            camera_skew_ms=(picture_ns - sweep.t_ns) / 1e6 if picture_ns is not None and sweep is not None else None,
            ego_age_ms=age_ms(frame.ego.t_ns if frame.ego is not None else None),
        )


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
    """What the line believes at one tick. ``pipeline.types.result_json.to_json`` writes it in the contract's form."""

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

    def chosen(self) -> FusedObject | None:
        """The object that is the CIPV; null without one."""
        return next((item for item in self.objects if self.cipv is not None and item.id == self.cipv.id), None)
