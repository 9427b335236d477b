"""What the API answers, as types: the result (docs/reference/results.md), the state of the stream, the parameters.

Answers are made elsewhere and sent as they are; these say what is in them, to OpenAPI and to who writes a client. A
test holds each against real answers, key by key.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from app.labels.service.tasks import TaskKind
from pipeline.types import ObjectSource

Point = tuple[float, float]


def file_of(media_type: str) -> dict[int | str, dict[str, Any]]:
    """What OpenAPI says of an answer that is a file."""
    return {200: {"content": {media_type: {}}, "description": "The file"}}


class _Exact(BaseModel):
    """No key more than is said."""

    model_config = ConfigDict(extra="forbid")


class StatusJson(_Exact):
    """status: what became of the request."""

    status: str


class Refusal(_Exact):
    """detail: why, in one sentence."""

    detail: str


class GateJson(_Exact):
    """One test of an object: its number, and the limit it was held against."""

    name: str
    value: float | None
    limit: float | None
    passed: bool


class CuboidJson(_Exact):
    """Ego frame, metres: centre x y z, length width height, heading in radians."""

    center: tuple[float, float, float]
    size: tuple[float, float, float]
    yaw_rad: float


class ObjectJson(_Exact):
    """Ego frame, metres and m/s; velocity is relative to us. bbox: x1 y1 x2 y2 in pixels of the camera."""

    id: int
    source: ObjectSource
    type: str | None
    type_score: float | None
    bbox: tuple[float, float, float, float] | None
    bev: list[Point] | None
    cuboid: CuboidJson | None
    closest_point: tuple[float, float, float] | None
    distance_m: float | None
    distance_sigma_m: float | None
    distance_from: Literal["cluster", "returns", "box"] | None
    velocity_mps: Point | None
    speed_over_ground_mps: float | None
    in_path: bool
    existence_probability: float | None
    in_path_probability: float | None
    path_offset_m: float | None
    moving: bool | None
    ttc_s: float | None
    carried: bool
    seen_by: ObjectSource | Literal[""]
    hits: int
    lidar_points: int
    lateral_mps: float | None
    crossing_s: float | None
    gates: list[GateJson]


class PathJson(_Exact):
    """The corridor in the ego frame, metres. sigma_m: by distance ahead. weights: by the sources that were fused."""

    source: str
    center: list[Point]
    left: list[Point]
    right: list[Point]
    sigma_m: dict[str, float | None]
    weights: dict[str, float | None]
    confidence: float | None
    usable: bool
    reach_m: float | None
    carried_by: dict[str, dict[str, float | None]]


class CipvJson(_Exact):
    """closing_speed_mps is positive when the gap shrinks; ttc_s is null when it does not."""

    id: int
    distance_m: float
    closing_speed_mps: float | None
    ttc_s: float | None
    reason: str


class RejectedJson(_Exact):
    """Why an object is not the CIPV."""

    id: int
    reason: str


class AccJson(_Exact):
    """accelerator and brake are 0–1. object_id: the object that it slows down for."""

    state: Literal["cruise", "follow", "stop", "warn", "partial_brake", "full_brake"]
    desired_speed_mps: float
    accel_mps2: float
    accelerator: float
    brake: float
    reason: str
    object_id: int | None


class EgoJson(_Exact):
    """Our own motion."""

    speed_mps: float
    yaw_rate_radps: float | None


class MotionSourceJson(_Exact):
    """What one source says of our own motion."""

    source: str
    speed_mps: float | None
    yaw_rate_radps: float | None


class OwnMotionJson(_Exact):
    """Where own motion is from. pose: x, y, heading since the LiDAR began to tell, null without it."""

    speed_from: str
    speed_sigma_mps: float | None
    yaw_rate_from: str | None
    yaw_rate_sigma_radps: float | None
    pose: list[float] | None
    sources: list[MotionSourceJson]


class ResultJson(_Exact):
    """One frame's result, version 1. What is unknown is null, never 0."""

    version: int
    frame: str
    t_ns: int
    sensors: dict[str, dict[str, Any]]
    ego: EgoJson | None
    own_motion: OwnMotionJson | None
    objects: list[ObjectJson]
    path: PathJson
    cipv: CipvJson | None
    next_cipv: CipvJson | None
    rejected: list[RejectedJson]
    acc: AccJson | None
    notes: list[str]
    timing_ms: dict[str, float | None]


class MetricJson(BaseModel):
    """One figure of both runs; better: which way is, null where neither."""

    name: str
    unit: str
    base: float | None
    run: float | None
    better: Literal["higher", "lower"] | None


class NoticeJson(_Exact):
    """A sentence for the person at the page."""

    level: Literal["info", "warning", "error"]
    text: str


class DriveStateJson(_Exact):
    """How far the whole drive is computed. revision grows whenever columns, runs, events or marks changed."""

    revision: int
    run: int | None
    base: int | None
    done: int
    total: int
    running: bool
    phase: Literal["detect", "run", "done", "failed"]
    note: str


class RecordingJson(_Exact):
    """file: the path on the server. seconds: of the drive. dropped: frames that the disk was too slow for; show it
    whenever it is not 0. error: why the recording ended by itself (a full disk); what came before is kept."""

    file: str
    frames: int
    seconds: float
    bytes: int
    dropped: int
    error: str | None


class LabelTaskJson(_Exact):
    """Something on labels that takes a while. It stays, with its note or error, until the next one begins."""

    id: int
    what: TaskKind
    done: int
    total: int
    note: str
    error: str | None
    running: bool


class LabelStateJson(_Exact):
    """revision: the number of acts; when it is another, GET /api/labels?since=."""

    revision: int
    task: LabelTaskJson | None


class StateJson(_Exact):
    """Source, position, playback. streams: how live sensors do, by sensor. sequence grows with every result. can_undo,
    can_redo: of changes of parameters that nobody put a name to; a person's own are in /api/labels and /api/params."""

    uri: str | None
    title: str
    rate_hz: float
    count: int
    index: int
    frame: str | None
    time_s: float
    duration_s: float
    playing: bool
    speed: float
    loop: bool
    busy: str | None
    detector: str | None
    lane_detector: str | None
    preset: str
    params_revision: int
    sequence: int
    skipped: int
    provisional: bool
    drive: DriveStateJson
    can_undo: bool
    can_redo: bool
    labels: LabelStateJson | None
    live: bool
    streams: dict[str, dict[str, Any]]
    recording: RecordingJson | None
    notices: list[NoticeJson]


class SourceJson(_Exact):
    """Something that can be opened."""

    uri: str
    title: str


class SourcesJson(_Exact):
    """open: the URI of what is open, null when nothing is."""

    open: str | None
    sources: list[SourceJson]


class ParamJson(BaseModel):
    """One parameter. min, max, step and unit are of numbers, choices of a choice."""

    model_config = ConfigDict(extra="forbid")

    key: str
    help: str
    kind: Literal["number", "integer", "boolean", "choice"]
    nullable: bool
    min: float | None = None
    max: float | None = None
    step: float | None = None
    unit: str | None = None
    choices: list[str] | None = None


class ParamSectionJson(_Exact):
    """Parameters of one stage, in the order in which they are declared."""

    name: str
    help: str
    params: list[ParamJson]


class ParamsJson(_Exact):
    """values and base (the preset's) by dotted name; effective: what null stands for with the shown camera and the
    detector in use. can_undo, can_redo: of the person who asks, or of steps that nobody put a name to."""

    preset: str
    presets: list[str]
    revision: int
    can_undo: bool
    can_redo: bool
    sections: list[ParamSectionJson]
    values: dict[str, float | str | bool | None]
    base: dict[str, float | str | bool | None]
    effective: dict[str, float]
