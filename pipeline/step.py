"""The straight line: one frame in, one result out, state in and state out.

    LiDAR:  deskew → down-sample → ground → cluster → boxes → tracks ─┐
    camera: (raw boxes) → select → distance → tracks ─────────────────┼→ fuse → motion → path → CIPV → ACC, AEB
    ego ──────────────────────────────────────────────────────────────┘

No stage keeps anything of its own: what must be remembered is in ``State``, so a frame can be run again from the same
state with other parameters, and the same inputs give the same bytes. A branch that a frame lacks predicts, and says so.
"""

from __future__ import annotations

import atexit
import gc
import threading
from dataclasses import dataclass
from functools import cache
from time import perf_counter_ns

import numpy as np

from pipeline.alignment import projection
from pipeline.common import kalman
from pipeline.common.geometry import iou_matrix
from pipeline.decision import acc, aeb, cipv, object_motion, path_position
from pipeline.ego_motion import coasting
from pipeline.fusion import agreement
from pipeline.fusion import fuse as fusion
from pipeline.lanes import road_lines as lanes
from pipeline.lidar import boxes, cluster, deskew, downsample, ground
from pipeline.lidar import tracking as lidar_tracking
from pipeline.lidar import warm_up as warm_up_lidar
from pipeline.params import Params
from pipeline.path import corridor, yaw_rate
from pipeline.types import (
    VEHICLES,
    CameraCalibration,
    EgoState,
    Frame,
    Ground,
    Layers,
    Obstacle,
    Result,
    SensorHealth,
    Sweep,
    VisionMeasurement,
)
from pipeline.vision import distance, nms
from pipeline.vision import tracking as vision_tracking


@dataclass(frozen=True)
class State:
    """All that one frame leaves to the next."""

    t_ns: int | None = None
    lidar: lidar_tracking.LidarTrackerState = lidar_tracking.LidarTrackerState()
    vision: vision_tracking.VisionTrackerState = vision_tracking.VisionTrackerState()
    fusion: fusion.FusionState = fusion.FusionState()
    agreement: agreement.AgreementState = agreement.AgreementState()
    own: EgoState | None = None
    lanes: lanes.LaneState = lanes.LaneState()
    path: corridor.PathState = corridor.PathState()
    cipv: cipv.CipvState = cipv.CipvState()
    acc: acc.AccState = acc.AccState()
    aeb: aeb.AebState = aeb.AebState()


def step(state: State, frame: Frame, params: Params) -> tuple[State, Result]:
    """Run every stage on one frame, whose ``raw_boxes`` the detector has filled already (``pipeline.run.detect``)."""
    state, dt_s = _continue_or_restart(state, frame, params)
    clock = _Stopwatch()
    aligned = projection.resolve(params.alignment, frame.camera)
    measured_ego = yaw_rate.believable(frame.ego)
    own = coasting.follow(state.own, measured_ego, dt_s, params.motion)
    ego = coasting.recent(own, params.motion)

    sweep = deskew.deskew(frame.sweep, ego, params.deskew)
    clock.lap("deskew")
    seen = _perceive_lidar(sweep, params, clock)
    lidar_state, lidar_tracks = lidar_tracking.track(
        state.lidar, seen.obstacles if frame.sweep else None, dt_s, params.lidar_tracking
    )
    clock.lap("lidar_tracking")

    measured = _perceive_picture(frame, aligned, params)
    clock.lap("distance")
    vision_state, vision_tracks = vision_tracking.track(
        state.vision, measured, dt_s, params.vision_tracking, ego.speed_mps if ego else None
    )
    clock.lap("vision_tracking")

    fusion_state, fused = fusion.fuse(
        state.fusion, lidar_tracks, vision_tracks, aligned, _picture_size(frame), params.fusion
    )
    clock.lap("fusion")
    objects = object_motion.describe(fused.objects, measured_ego, params.motion)
    vehicles = [each.detection.bbox for each in measured or () if each.detection.label in VEHICLES]
    road_z_m = frame.camera.road_z_m if frame.camera is not None else None
    lane_state, lane = lanes.follow(
        state.lanes, frame.raw_lanes, aligned, seen.ground, ego, dt_s, params.lanes, vehicles, road_z_m
    )
    clock.lap("lanes")
    moved_by = frame.ego if measured_ego is not None else own
    path_state, path = corridor.predict(
        state.path, moved_by, lane, frame.gnss, frame.route, frame.t_ns, dt_s, params.path
    )
    agreed = agreement.follow(state.agreement, objects, dt_s, params.fusion)
    path = agreement.heed(path, agreed, params.fusion)
    clock.lap("path")
    cipv_state, chosen = cipv.choose(state.cipv, objects, path, ego, dt_s, params.cipv)
    objects, lead = chosen.objects, chosen.lead
    clock.lap("cipv")
    acc_state, command = acc.control(state.acc, ego, lead, objects, path, dt_s, params.acc)
    clock.lap("acc")
    aeb_state, command = aeb.guard(state.aeb, command, ego, lead, objects, path, dt_s, params.aeb, params.acc)
    clock.lap("aeb")

    result = Result(
        frame=frame.name,
        t_ns=frame.t_ns,
        sensors=_health(frame),
        ego=frame.ego,
        objects=objects,
        path=path,
        cipv=lead,
        next_cipv=chosen.next_lead,
        rejected=chosen.rejected,
        acc=command,
        notes=(*frame.notes, *path.notes),
        streams=frame.streams,
        timing_ms={**frame.timing_ms, **clock.total()},
        layers=Layers(
            points=sweep.points if sweep else np.zeros((0, 4), np.float32),
            kind=seen.kind,
            obstacles=seen.obstacles,
            lidar_tracks=lidar_tracks,
            vision_tracks=vision_tracks,
            lidar_boxes=fused.lidar_boxes,
            vision_boxes=fused.vision_boxes,
            ground=seen.ground,
            lanes=lane,
        ),
    )
    return State(
        frame.t_ns,
        lidar_state,
        vision_state,
        fusion_state,
        agreed,
        own,
        lane_state,
        path_state,
        cipv_state,
        acc_state,
        aeb_state,
    ), result


def warm_up() -> None:
    """Compile every kernel before the first frame, so that the first frame is as fast as the rest, and keep the garbage
    collector of the process from what is loaded by then and from the frames. Once: a second thread that comes meanwhile
    waits for the first."""
    with _WARMING:
        _warm_up()


_WARMING = threading.Lock()


@cache
def _warm_up() -> None:
    warm_up_lidar()
    one = np.eye(2)
    kalman.update(kalman.predict(kalman.start((0.0, 0.0), one, 1.0), 0.1, 1.0), (0.0, 0.0), one)
    iou_matrix(np.zeros((1, 4)), np.zeros((1, 4)))
    lanes.warm_up()
    corridor.warm_up()
    path_position.warm_up()
    _spare_the_frames()


def spare_what_is_loaded() -> None:
    """Modules and kernels live as long as the process: a full collection that looks through them all takes 0.1 s, and
    would do so in the middle of a frame. To be called again when as much was imported later. (Nothing is collected
    before: what imports leave behind is some tens of objects, and looking for them takes 0.06 s of every start.)"""
    gc.freeze()


_COLLECT_AFTER = 5_000
"""Records that a frame makes, with some to spare."""


def _spare_the_frames() -> None:
    """A frame's thousand records are freed when the next result takes their place, without a collector: the small
    collections would find nothing in every frame."""
    spare_what_is_loaded()
    atexit.register(gc.unfreeze)  # at the end everything is let go of, or extension modules complain of leaks
    gc.set_threshold(_COLLECT_AFTER, *gc.get_threshold()[1:])


@dataclass(frozen=True)
class _LidarView:
    """What one sweep holds: its obstacles, and for each of its (N,) points what it was taken for."""

    obstacles: tuple[Obstacle, ...]
    kind: np.ndarray
    ground: Ground | None


def _perceive_lidar(sweep: Sweep | None, params: Params, clock: _Stopwatch) -> _LidarView:
    """down-sample → ground → cluster → boxes (paper, Point Cloud Segmentation)."""
    if sweep is None:
        return _LidarView((), np.zeros(0, np.int32), None)
    keep = downsample.keep_mask(sweep, params.downsample)
    clock.lap("downsample")
    plane = ground.fit_ground(sweep.points, keep, params.ground)
    clock.lap("ground")
    candidates = cluster.candidates(sweep.points, plane, keep, params.cluster)
    labels = cluster.cluster(sweep.points, candidates, params.cluster)
    clock.lap("cluster")
    obstacles = boxes.fit_obstacles(sweep.points, labels, plane, params.box)
    clock.lap("boxes")
    return _LidarView(obstacles, cluster.kinds(labels, keep, plane.mask), plane)


def _perceive_picture(
    frame: Frame, aligned: projection.Alignment | None, params: Params
) -> tuple[VisionMeasurement, ...] | None:
    """Raw boxes → thresholds and suppression → distance. Null when the camera or the detector gave nothing."""
    if frame.raw_boxes is None:
        return None
    detections = nms.select(frame.raw_boxes, params.detection)
    return distance.measure(detections, aligned, frame.camera, params.distance, frame.raw_boxes.law)


def _continue_or_restart(state: State, frame: Frame, params: Params) -> tuple[State, float | None]:
    """Seconds since the frame before, from the sensors' own stamps; a fresh state after a gap or a jump back, because
    a track carried over either would be a guess. Numbers of objects are never given twice."""
    if state.t_ns is None:
        return state, None
    dt_s = (frame.t_ns - state.t_ns) / 1e9
    if 0.0 < dt_s <= params.time.reset_gap_s:
        return state, dt_s
    return State(fusion=fusion.FusionState(next_id=state.fusion.next_id)), None


def _picture_size(frame: Frame) -> tuple[int, int] | None:
    """(width, height) of the picture, or of the calibration where the picture itself is missing."""
    if frame.picture is not None:
        return frame.picture.bgr.shape[1], frame.picture.bgr.shape[0]
    camera: CameraCalibration | None = frame.camera
    return (camera.width, camera.height) if camera is not None else None


def _health(frame: Frame) -> SensorHealth:
    def age(t_ns: int | None) -> float | None:
        return None if t_ns is None else (frame.t_ns - t_ns) / 1e6

    sweep, picture = frame.sweep, frame.picture
    return SensorHealth(
        lidar_age_ms=age(sweep.t_ns if sweep else None),
        lidar_points=len(sweep.points) if sweep else None,
        camera_age_ms=age(picture.t_ns if picture else None),
        camera_skew_ms=(picture.t_ns - sweep.t_ns) / 1e6 if picture and picture.t_ns is not None and sweep else None,
        ego_age_ms=age(frame.ego.t_ns if frame.ego else None),
    )


class _Stopwatch:
    """Milliseconds between laps."""

    def __init__(self) -> None:
        self._start = self._last = perf_counter_ns()
        self._laps: dict[str, float] = {}

    def lap(self, stage: str) -> None:
        now = perf_counter_ns()
        self._laps[stage] = (now - self._last) / 1e6
        self._last = now

    def total(self) -> dict[str, float]:
        return {**self._laps, "total": (perf_counter_ns() - self._start) / 1e6}
