"""The result of a frame (docs/reference/results.md), as types."""

from __future__ import annotations

from typing import Any, Literal

from app.web.routes.shapes.common import CuboidJson, Exact, Point, SensorLetters


class GateJson(Exact):
    """One test of an object."""

    name: str
    """See the table of gates in the results contract."""
    value: float | None
    """What was measured; null when there was nothing to test."""
    limit: float | None
    """What it was compared with."""
    passed: bool
    """Whether it passed."""


class ObjectJson(Exact):
    """One object; ego frame, metres and m/s."""

    id: int
    """The same for as long as the object is tracked; never reused within a run."""
    source: SensorLetters
    """Which sensors' tracks it is made of: V camera, L LiDAR, VL both."""
    type: str | None
    """Class by the detector; null for L."""
    type_score: float | None
    """The detector's score, 0–1; null for L."""
    bbox: tuple[float, float, float, float] | None
    """x1 y1 x2 y2 in pixels of the raw image; null outside it."""
    bev: list[Point] | None
    """x, y of the footprint's four corners. V: a typical footprint of its class."""
    cuboid: CuboidJson | None
    """The box around its LiDAR points; null for V."""
    closest_point: tuple[float, float, float] | None
    """x, y, z of the point nearest to the ego origin."""
    distance_m: float | None
    """Horizontal range from the ego origin to the nearest point; null when unknown."""
    distance_sigma_m: float | None
    """Standard deviation of the distance."""
    distance_from: str | None
    """What measured the distance in this frame: cluster, returns, box or the name of a further ranging sensor; null
    when nothing did."""
    height_from: Literal["class", "shape", "road", "range"] | None
    """V: what the height that the distance rests on was taken from; null otherwise."""
    velocity_mps: Point | None
    """x, y relative to ego; null until seen twice."""
    speed_over_ground_mps: float | None
    """Null where ego speed is unknown."""
    speed_over_ground_sigma_mps: float | None
    """Its standard deviation; null where it is not known."""
    in_path: bool
    """Whether ``in_path_probability`` is over one half."""
    existence_probability: float | None
    """That it is really there, by the evidence of both sensors; null where that is not weighed."""
    in_path_probability: float | None
    """By all its sightings so far, recent ones weighted most."""
    path_offset_m: float | None
    """From the path's centre to the middle of its nearest face, positive to the left."""
    moving: bool | None
    """Over the ground; null where ego speed is unknown."""
    ttc_s: float | None
    """Time to collision; null when the gap does not shrink."""
    carried: bool
    """Not seen in this frame: its position is predicted."""
    seen_by: SensorLetters | Literal[""]
    """Which sensors saw it in this frame; empty when carried."""
    hits: int
    """Sightings so far."""
    lidar_points: int
    """Of its cluster; 0 for V."""
    lateral_mps: float | None
    """Speed over ground across the path, positive to the left."""
    crossing_s: float | None
    """Until it enters the path, or leaves it if it is inside; null when its lateral speed leads to neither."""
    gates: list[GateJson]
    """Every test that the object went through."""


class PathJson(Exact):
    """The corridor in the ego frame."""

    source: str
    """The dominant source at 30 m; ``fused`` when none dominates."""
    center: list[Point]
    """x, y from the bumper on."""
    left: list[Point]
    """x, y of the left edge, which need not be parallel to the centre."""
    right: list[Point]
    """x, y of the right edge."""
    sigma_m: dict[str, float | None]
    """Standard deviation of the centre's lateral position, by distance ahead in metres."""
    weights: dict[str, float | None]
    """Each source's share over the whole path."""
    confidence: float | None
    """0–1: that the true centre is within the corridor as far as is needed at this speed."""
    usable: bool
    """Whether it reaches far enough at this speed and nothing contradicts it."""
    reach_m: float | None
    """How far it is certain enough to follow."""
    carried_by: dict[str, dict[str, float | None]]
    """Each source's share, by distance ahead in metres."""


class CipvJson(Exact):
    """The closest in-path vehicle, or the expected next one."""

    id: int
    """Of the object."""
    distance_m: float
    """As of the object."""
    closing_speed_mps: float | None
    """Positive when the gap shrinks."""
    ttc_s: float | None
    """Null when the gap does not shrink."""
    reason: str
    """Why it is this one, in words."""
    accel_mps2: float | None = None
    """Its acceleration over ground; null until it is known well enough, and for the next CIPV."""
    accel_sigma_mps2: float | None = None
    """Standard deviation of that."""


class RejectedJson(Exact):
    """Why an object is not the CIPV."""

    id: int
    """Of the object."""
    reason: str
    """In words, which may change; ``gates`` are for scripts."""


class AccJson(Exact):
    """The command of cruise control and emergency braking."""

    state: Literal["cruise", "follow", "stop", "warn", "partial_brake", "full_brake"]
    """What it is doing."""
    desired_speed_mps: float
    """By the speed law."""
    accel_mps2: float
    """Requested; negative brakes."""
    accelerator: float
    """Pedal, 0–1."""
    brake: float
    """Pedal, 0–1."""
    reason: str
    """In words."""
    object_id: int | None
    """The object it slows down for; null for none."""


class EgoJson(Exact):
    """Ego motion."""

    speed_mps: float
    """Over ground."""
    yaw_rate_radps: float | None
    """Positive to the left; null when no sensor gives it."""


class MotionSourceJson(Exact):
    """What one source reports of ego motion."""

    source: str
    """Which one."""
    speed_mps: float | None
    """Null when it does not give one."""
    yaw_rate_radps: float | None
    """Null when it does not give one."""


class OwnMotionJson(Exact):
    """Where ego motion comes from."""

    speed_from: str
    """``can``, ``ins``, ``gnss`` or ``lidar``."""
    speed_sigma_mps: float | None
    """Standard deviation of the speed."""
    yaw_rate_from: str | None
    """As ``speed_from``; null where no yaw rate is measured."""
    yaw_rate_sigma_radps: float | None
    """Standard deviation of the yaw rate."""
    pose: list[float] | None
    """x, y, heading since LiDAR odometry began; null without it."""
    sources: list[MotionSourceJson]
    """What each source reports."""


class ResultJson(Exact):
    """One frame's result, version 1. What is unknown is null, never 0."""

    version: int
    """Of the contract."""
    frame: str
    """The frame's name in the recording."""
    t_ns: int
    """The tick, nanoseconds on the recording's timeline."""
    sensors: dict[str, dict[str, Any]]
    """What each sensor contributed to the frame."""
    ego: EgoJson | None
    """Null where ego speed is unknown."""
    own_motion: OwnMotionJson | None
    """Null where ego motion is not measured."""
    objects: list[ObjectJson]
    """Every fused object, nearest first."""
    path: PathJson
    """Where the car is going."""
    cipv: CipvJson | None
    """Null when nobody leads."""
    next_cipv: CipvJson | None
    """The expected next lead; null for none."""
    rejected: list[RejectedJson]
    """Why each other object is not the CIPV."""
    acc: AccJson | None
    """Null when ego speed has been unknown for too long."""
    notes: list[str]
    """What is wrong in this frame, for a person."""
    timing_ms: dict[str, float | None]
    """Milliseconds of each stage, and their total."""
