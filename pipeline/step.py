"""The pipeline: one frame in, one result out; state in and state out.

    LiDAR:  deskew → down-sample → ground → cluster → boxes → tracks ─┐   (``lidar_branch``, beside the networks)
    camera: (raw boxes) → select → distance → tracks ─────────────────┼→ fuse → motion → path → CIPV → ACC, AEB
    further ranging sensors: (scans) → tracks ────────────────────────┤
    ego ──────────────────────────────────────────────────────────────┘

Stages have no hidden state: everything that the next frame needs is in ``State``. A frame can therefore be run again
from the same state with other parameters, and the same inputs give the same bytes. If a sensor is missing from the
frame, its branch predicts, and its results say so.
"""

from __future__ import annotations

from dataclasses import dataclass

from pipeline import lidar_branch
from pipeline.alignment import projection
from pipeline.common.stopwatch import Stopwatch
from pipeline.decision import acc, aeb, braking_evidence, cipv, lead_motion, object_motion
from pipeline.ego_motion import own_motion
from pipeline.fusion import agreement, existence, ground_contact, merged_clusters, returns
from pipeline.fusion import fuse as fusion
from pipeline.fusion.drift import follow as drift
from pipeline.fusion.drift import lines as drift_lines
from pipeline.lanes import road_lines as lanes
from pipeline.lidar import tracking as lidar_tracking
from pipeline.params import Params
from pipeline.path import corridor, drivable_area, road_edges, traffic, yaw_rate
from pipeline.ranging import further
from pipeline.types import (
    VEHICLES,
    Box,
    EgoState,
    Frame,
    Ground,
    Layers,
    Result,
    SensorHealth,
    Situation,
    VisionMeasurement,
)
from pipeline.vision import distance, nms
from pipeline.vision import tracking as vision_tracking


@dataclass(frozen=True)
class State:
    """The state that one frame passes to the next, by stage."""

    t_ns: int | None = None
    """Time of the last frame; None before the first."""
    lidar: lidar_tracking.LidarTrackerState = lidar_tracking.LidarTrackerState()
    """Tracks of the LiDAR's clusters."""
    vision: vision_tracking.VisionTrackerState = vision_tracking.VisionTrackerState()
    """Tracks of the camera's boxes."""
    ranging: further.RangingState = further.RangingState()
    """Tracks of further ranging sensors."""
    fusion: fusion.FusionState = fusion.FusionState()
    """Which object each track belongs to."""
    existence: existence.ExistenceState = existence.ExistenceState()
    """Evidence for and against each object."""
    agreement: agreement.AgreementState = agreement.AgreementState()
    """How often camera and LiDAR agree."""
    drift: drift.DriftState = drift.DriftState()
    """What vehicles have shown of the angle between the two sensors."""
    own: EgoState | None = None
    """Ego motion of the last frame, measured or coasted; None while unknown."""
    measured: own_motion.OwnMotionState = own_motion.OwnMotionState()
    """Odometry and GNSS courses of earlier frames."""
    ground: Ground | None = None
    """Ground of the last sweep; used by LiDAR odometry."""
    lanes: lanes.LaneState = lanes.LaneState()
    """Tracked lines and the camera's pitch."""
    edges: road_edges.EdgeState = road_edges.EdgeState()
    """Structure beside the road, moved along with the car."""
    traffic: traffic.TrafficState = traffic.NONE
    """Where vehicles have driven, moved along with the car."""
    drivable: drivable_area.DrivableState = drivable_area.DrivableState()
    """The path along the drivable area in the last image."""
    path: corridor.PathState = corridor.PathState()
    """Smoothed path and position on the route."""
    cipv: cipv.CipvState = cipv.CipvState()
    """The lead, and the odds that each object is in the path."""
    lead: lead_motion.LeadMotionState = lead_motion.LeadMotionState()
    """Speed and acceleration of the lead."""
    acc: acc.AccState = acc.AccState()
    """State of the speed controller."""
    aeb: aeb.AebState = aeb.AebState()
    """The active stage of emergency braking, and its cause."""


def step(
    state: State, frame: Frame, params: Params, lidar: lidar_branch.LidarBranch | None = None
) -> tuple[State, Result]:
    """Run every stage on one frame. The networks have already run: their outputs are ``frame.raw_boxes`` and
    ``frame.raw_lanes`` (``pipeline.detection.detect``). lidar: result of ``lidar_branch.follow`` for these arguments,
    if it ran beside them."""
    clock = Stopwatch()
    # Own motion, and the LiDAR: objects on the ground in this sweep, tracked from sweep to sweep
    lidar = lidar if lidar is not None else lidar_branch.follow(state, frame, params)
    motion, now, sweep, lidar_tracks = lidar.motion, lidar.now, lidar.sweep, lidar.tracks
    clock.skip()
    state = state if now.dt_s is not None else _restarted(state)
    aligned = projection.resolve(params.alignment, frame.camera)

    # Camera: the detector's boxes, each with a distance from its height, tracked from image to image
    boxes = _measure_boxes(frame, aligned, params)
    boxes = merged_clusters.range_boxes(boxes, sweep, aligned, params.fusion)
    boxes = returns.range_boxes(boxes, sweep, aligned, params.fusion)
    road = ground_contact.road_ahead(sweep.points, sweep.ground, boxes, aligned, now.speed_mps)
    boxes = ground_contact.measure_contacts(boxes, road, aligned, params.fusion)
    clock.lap("distance")
    vision_state, vision_tracks = vision_tracking.track(
        state.vision, boxes, now.dt_s, params.vision_tracking, now.speed_mps, _pan_pxps(aligned, now.ego)
    )
    clock.lap("vision_tracking")

    # Further ranging sensors, such as a radar: their detections, tracked from scan to scan
    ranging_state, ranged = further.follow(state.ranging, frame.scans, now, params)

    # Fusion: a cluster and a box that overlap in the image are one object, and so is what a ranging sensor has there
    fusion_state, fused = fusion.fuse(
        state.fusion, lidar_tracks, vision_tracks, aligned, frame.image_size, params.fusion, ranged
    )
    if fused.bereft and params.vision_tracking.forget_heights:
        vision_state, vision_tracks = vision_tracking.forget_heights(vision_state, vision_tracks, fused.bereft)
        fusion_state, fused = fusion.fuse(
            state.fusion, lidar_tracks, vision_tracks, aligned, frame.image_size, params.fusion, ranged
        )
    vision_state = vision_tracking.learn_heights(vision_state, fused.ranged_boxes(), params.vision_tracking)
    clock.lap("fusion")
    # Existence: evidence from each sensor for and against every object being at its reported position
    existence_state, objects = existence.weigh(state.existence, fused.objects, sweep, frame, now, params.existence)
    clock.lap("existence")
    objects = object_motion.describe(objects, now.measured, params.motion, now.dt_s)

    # Path: lane lines, the route, the yaw rate, the road's edges, other vehicles and the drivable area, each
    # weighted by its certainty
    road_z_m = frame.camera.road_z_m if frame.camera is not None else None
    view = lanes.RoadView(aligned, sweep.ground, road_z_m, _vehicle_boxes(boxes))
    lane_state, lane = lanes.follow(state.lanes, frame.raw_lanes, view, now, params.lanes)
    clock.lap("lanes")
    # A knocked mount: both sensors see the same vehicles and road, but with an angle between them
    shown = drift.Seen(
        frame.t_ns,
        frame.name,
        lidar_tracks,
        boxes,
        road,
        frame.image_size,
        _road_lines(lane_state.measured, now.measured),
    )
    drift_state, turned = drift.follow(state.drift, shown, aligned, params.alignment, params.fusion)
    clock.lap("drift")
    ring = frame.sweep.ring if frame.sweep is not None else None
    around = road_edges.Surroundings(
        sweep.points, sweep.kind, ring, sweep.ground, lidar_tracks, objects, sweep.sensor_height_m, sweep.origin
    )
    edge_state, edges = road_edges.follow(state.edges, around, now, params.path, state.path.is_shown)
    clock.lap("edges")
    traffic_state, driving = traffic.follow(state.traffic, objects, now, params.path)
    sides = lanes.road_edges(frame.raw_lanes, view, lane_state, now, params.lanes)
    drivable_state, area = drivable_area.follow(state.drivable, sides, now, params.path, state.path.is_shown)
    evidence = corridor.Evidence(
        lane,
        frame.gnss,
        frame.route,
        edges.path if edges is not None else None,
        driving.path if driving is not None else None,
        area.path if area is not None else None,
    )
    path_state, path = corridor.predict(state.path, evidence, now, params.path)
    agreement_state = agreement.follow(state.agreement, objects, now.dt_s, params.fusion)
    path = agreement.heed(path, agreement_state, params.fusion)
    clock.lap("path")

    # Decision: the nearest vehicle in the path, a speed that keeps the gap to it, and emergency braking
    cipv_state, chosen = cipv.choose(state.cipv, objects, path, now, params.cipv)
    clock.lap("cipv")
    objects = braking_evidence.judge(chosen.objects, params.existence)
    lead_state, lead = lead_motion.follow(state.lead, chosen.lead, objects, now)
    situation = Situation(now, path, objects, lead)
    acc_state, command = acc.control(state.acc, situation, params.acc, params.aeb)
    clock.lap("acc")
    aeb_state, command = aeb.guard(state.aeb, command, situation, params.aeb, params.acc)
    clock.lap("aeb")

    layers = Layers(
        points=sweep.points,
        kind=sweep.kind,
        obstacles=sweep.obstacles or (),
        lidar_tracks=lidar_tracks,
        vision_tracks=vision_tracks,
        lidar_boxes=fused.lidar_boxes,
        vision_boxes=fused.vision_boxes,
        ground=sweep.ground,
        lanes=lane,
        edges=edges.cells if edges is not None else None,
        traffic=driving.headings if driving is not None else None,
        drivable=area.edges if area is not None else None,
    )
    result = Result(
        frame=frame.name,
        t_ns=frame.t_ns,
        sensors=SensorHealth.of(frame),
        ego=motion.ego,
        own_motion=motion.own,
        objects=objects,
        path=path,
        cipv=lead,
        next_cipv=chosen.next_lead,
        rejected=chosen.rejected,
        acc=command,
        notes=(*frame.notes, *yaw_rate.doubts(frame.ego), *motion.notes, *path.notes, *_note_of(turned)),
        streams=frame.streams,
        timing_ms={**frame.timing_ms, **lidar.timing_ms, **clock.timing_ms()},
        layers=layers,
    )
    following = State(
        t_ns=frame.t_ns,
        lidar=lidar.tracker,
        vision=vision_state,
        ranging=ranging_state,
        fusion=fusion_state,
        existence=existence_state,
        agreement=agreement_state,
        drift=drift_state,
        own=now.motion,
        measured=motion.state,
        ground=sweep.ground or state.ground,
        lanes=lane_state,
        edges=edge_state,
        traffic=traffic_state,
        drivable=drivable_state,
        path=path_state,
        cipv=cipv_state,
        lead=lead_state,
        acc=acc_state,
        aeb=aeb_state,
    )
    return following, result


def _road_lines(measured: lanes.LaneMeasurement | None, ego: EgoState | None) -> drift_lines.RoadLines | None:
    """The lines of this image that are certain, for the comparison with the car's own motion."""
    if measured is None:
        return None
    speed_mps, yaw_rate_radps = (ego.speed_mps, ego.yaw_rate_radps) if ego is not None else (None, None)
    return drift_lines.of_measured(measured.lines, measured.pitch.rad, speed_mps, yaw_rate_radps)


def _note_of(turned: drift.Drift | None) -> tuple[str, ...]:
    return (turned.note,) if turned is not None else ()


def _restarted(state: State) -> State:
    """After a gap or a jump back in time: tracks carried over it would be guesses. Only object ids continue, so that
    none is used twice."""
    return State(fusion=fusion.FusionState(next_id=state.fusion.next_id))


def _measure_boxes(
    frame: Frame, aligned: projection.Alignment | None, params: Params
) -> tuple[VisionMeasurement, ...] | None:
    """The detector's boxes after thresholds and suppression, each with its estimated distance; None without an image or
    without detections."""
    if frame.raw_boxes is None:
        return None
    detections = nms.select(frame.raw_boxes, params.detection)
    return distance.measure(detections, aligned, frame.camera, params.distance, frame.raw_boxes.law)


def _pan_pxps(aligned: projection.Alignment | None, ego: EgoState | None) -> float | None:
    """Speed at which a distant object straight ahead moves to the right in the image because the car turns; None if
    that is not known."""
    rate_radps = yaw_rate.usable_rate(ego) if ego is not None and ego.coasting is None else None
    px_per_rad = projection.pixels_per_radian(aligned) if aligned is not None else None
    return rate_radps * px_per_rad if rate_radps is not None and px_per_rad is not None else None


def _vehicle_boxes(boxes: tuple[VisionMeasurement, ...] | None) -> list[Box]:
    """Boxes of vehicles that hide the road in the image."""
    return [each.detection.bbox for each in boxes or () if each.detection.label in VEHICLES]
