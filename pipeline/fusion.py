"""LiDAR and vision tracks become one list of objects: V, VL, L (paper, Algorithm 2 and Table 3).

The printed algorithm swaps its indices and emits an "only LiDAR" row for every pair that is not the maximum. Built here
is what it means: every LiDAR track and every vision track lands in exactly one row, a claimed pair in one row together,
so V + VL = vision tracks and L + VL = LiDAR tracks, always.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.alignment import Alignment, project_cuboids
from pipeline.geometry import F64, corners_of, iou_matrix
from pipeline.params import FusionParams
from pipeline.types import Box, FusedObject, Gate, LidarTrack, Point2, VisionTrack

LIDAR_RANGE_SIGMA_M = 0.1
"""Uncertainty of a cluster's nearest point: the VLP-16's ±3 cm and the spacing of its beams on a bumper."""

CARRIED_SPEED_SIGMA_MPS, CARRIED_ACCEL_SIGMA_MPS2 = 0.5, 3.0

TYPICAL_SIZE_M = {
    "car": (4.5, 1.8),
    "truck": (8.0, 2.5),
    "bus": (11.0, 2.5),
    "motorcycle": (2.1, 0.8),
    "bicycle": (1.8, 0.6),
    "person": (0.5, 0.5),
}
"""Length and width drawn for an object that only the camera sees; its nearest face is what was measured."""


@dataclass(frozen=True)
class FusionState:
    """Which fused identity each sensor's track carries, so that an object keeps its number from V to VL to L."""

    next_id: int = 1
    by_lidar: dict[int, int] = field(default_factory=dict)
    by_vision: dict[int, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Fusion:
    """objects in order of distance; lidar_boxes and vision_boxes: the image boxes that were compared, by object id."""

    objects: tuple[FusedObject, ...]
    lidar_boxes: dict[int, Box]
    vision_boxes: dict[int, Box]


def fuse(
    state: FusionState,
    lidar: tuple[LidarTrack, ...],
    vision: tuple[VisionTrack, ...],
    alignment: Alignment | None,
    picture_size: tuple[int, int] | None,
    params: FusionParams,
) -> tuple[FusionState, Fusion]:
    """One row per physical object. ``picture_size`` is (width, height) in pixels; without it or without an alignment
    nothing can be compared, and every track keeps a row of its own."""
    corners = corners_of([track.obstacle.cuboid for track in lidar])
    projected: list[Box | None] = [None] * len(lidar)
    if alignment is not None and picture_size is not None:
        projected = project_cuboids(alignment, _to_the_gaps(corners, lidar, params), *picture_size)
    overlap = _overlap(vision, projected)
    joinable, gates = _gates(overlap, vision, lidar, params)
    partner = _assign(overlap, joinable, params)

    pairs: list[tuple[int | None, int | None]] = [(i, partner.get(i)) for i in range(len(vision))]
    claimed = set(partner.values())
    pairs += [(None, j) for j in range(len(lidar)) if j not in claimed]

    keys = [(vision[i].id if i is not None else None, lidar[j].id if j is not None else None) for i, j in pairs]
    state, ids = _identities(state, keys)
    objects, lidar_boxes, vision_boxes = [], {}, {}
    for object_id, (i, j) in zip(ids, pairs, strict=True):
        seen, hit = (vision[i] if i is not None else None), (lidar[j] if j is not None else None)
        box = projected[j] if j is not None else None
        tested = gates[i, j] if i is not None and j is not None else _nearest_miss(overlap, gates, i, j)
        footprint = corners[j, :4, :2] if j is not None else None
        objects.append(_row(object_id, seen, hit, box, footprint, tested))
        if box is not None:
            lidar_boxes[object_id] = box
        if seen is not None:
            vision_boxes[object_id] = seen.bbox
    objects.sort(key=lambda o: (o.distance_m is None, o.distance_m or 0.0, o.id))
    return state, Fusion(tuple(objects), lidar_boxes, vision_boxes)


def _to_the_gaps(corners: F64, lidar: tuple[LidarTrack, ...], params: FusionParams) -> F64:
    """(M, 8, 3) corners made taller by half the gap between rings at either end: an object's edge lies anywhere between
    the last ring that hit it and the next one that did not. At 25 m a gap is 0.9 m, half a car."""
    margin = np.array([_range(track) for track in lidar]) * math.tan(math.radians(params.ring_gap_deg / 2))
    taller = corners.copy()
    taller[:, :4, 2] -= margin[:, None]
    taller[:, 4:, 2] += margin[:, None]
    return taller


def _overlap(vision: tuple[VisionTrack, ...], projected: list[Box | None]) -> F64:
    """(n, m) IoU of vision boxes and projected LiDAR cuboids; zero for a cuboid outside the picture."""
    nowhere = (0.0, 0.0, 0.0, 0.0)
    return iou_matrix(np.array([v.bbox for v in vision]), np.array([box or nowhere for box in projected]))


def _gates(
    overlap: F64, vision: tuple[VisionTrack, ...], lidar: tuple[LidarTrack, ...], params: FusionParams
) -> tuple[np.ndarray, dict[tuple[int, int], tuple[Gate, ...]]]:
    """Which pairs may be one object, and the tests each overlapping pair went through."""
    joinable = np.zeros(overlap.shape, dtype=bool)
    gates: dict[tuple[int, int], tuple[Gate, ...]] = {}
    for i, j in np.argwhere(overlap > 0):
        iou = float(overlap[i, j])
        tests = [Gate("iou", iou, params.min_iou, iou >= params.min_iou)]
        distance, sigma = vision[i].distance_m, vision[i].sigma_m
        # boxes of nearly one place and size are one object: there it is the height law that errs, not the LiDAR
        doubtful = params.range_gate and iou < params.sure_iou
        if doubtful and distance is not None and sigma is not None:
            gap = abs(distance - _range(lidar[j])) / math.hypot(sigma, _lidar_sigma(lidar[j]))
            tests.append(Gate("range_sigmas", gap, params.range_gate_sigmas, gap <= params.range_gate_sigmas))
        joinable[i, j] = all(test.passed for test in tests)
        gates[int(i), int(j)] = tuple(tests)
    return joinable, gates


def _assign(overlap: F64, joinable: np.ndarray, params: FusionParams) -> dict[int, int]:
    """Vision index → LiDAR index, one-to-one, among joinable pairs only."""
    score = np.where(joinable, overlap, 0.0)
    if params.assignment == "optimal":
        rows, columns = linear_sum_assignment(score, maximize=True)
        return {int(i): int(j) for i, j in zip(rows, columns, strict=True) if joinable[i, j]}
    chosen: dict[int, int] = {}
    for i in range(score.shape[0]):
        free = np.where(np.isin(np.arange(score.shape[1]), list(chosen.values())), 0.0, score[i])
        if free.size and free.max() > 0:
            chosen[i] = int(np.argmax(free))
    return chosen


def _identities(state: FusionState, keys: list[tuple[int | None, int | None]]) -> tuple[FusionState, list[int]]:
    """The fused id of each (vision track, LiDAR track) row. A row inherits the oldest identity of its tracks that no
    other row has taken; pairs choose first, so that a lone fragment never takes a whole object's number."""
    order = sorted(range(len(keys)), key=lambda k: (None in keys[k], k))
    ids = [0] * len(keys)
    taken: set[int] = set()
    next_id = state.next_id
    for k in order:
        seen, hit = keys[k]
        known = [
            table[track]
            for table, track in ((state.by_lidar, hit), (state.by_vision, seen))
            if track is not None and track in table and table[track] not in taken
        ]
        ids[k] = min(known) if known else next_id
        next_id += not known
        taken.add(ids[k])
    by_lidar = {hit: ids[k] for k, (_, hit) in enumerate(keys) if hit is not None}
    by_vision = {seen: ids[k] for k, (seen, _) in enumerate(keys) if seen is not None}
    return FusionState(next_id, by_lidar, by_vision), ids


def _nearest_miss(
    overlap: F64, gates: dict[tuple[int, int], tuple[Gate, ...]], i: int | None, j: int | None
) -> tuple[Gate, ...]:
    """For an object seen by one sensor only: the tests of the partner it overlapped most, which say why it is alone."""
    line = overlap[i] if i is not None else overlap[:, j]
    if not line.size or line.max() <= 0:
        return ()
    best = int(np.argmax(line))
    return gates[(i, best) if i is not None else (best, int(j or 0))]


def _row(
    object_id: int,
    seen: VisionTrack | None,
    hit: LidarTrack | None,
    box: Box | None,
    footprint: F64 | None,
    gates: tuple[Gate, ...],
) -> FusedObject:
    """Table 3: place, distance and velocity from the LiDAR where it has the object, the type from the camera."""
    label, score = (seen.label, seen.score) if seen is not None else (None, None)
    if hit is not None and footprint is not None:
        return FusedObject(
            id=object_id,
            source="VL" if seen is not None else "L",
            label=label,
            score=score,
            bbox=box if box is not None else (seen.bbox if seen is not None else None),
            bev=_quad(footprint),
            cuboid=hit.obstacle.cuboid,
            closest_point=hit.obstacle.closest_point,
            distance_m=_range(hit),
            distance_sigma_m=_lidar_sigma(hit),
            velocity_mps=_velocity(seen, hit),
            seen_by=_seen_by(seen, hit),
            measured=not hit.carried,
            hits=max(hit.hits, seen.hits) if seen is not None else hit.hits,
            lidar_points=hit.obstacle.points,
            lidar_track=hit.id,
            vision_track=seen.id if seen is not None else None,
            gates=gates,
        )
    assert seen is not None
    place = seen.position
    return FusedObject(
        id=object_id,
        source="V",
        label=label,
        score=score,
        bbox=seen.bbox,
        bev=_quad(_typical_footprint(place, seen.label)) if place is not None else None,
        cuboid=None,
        closest_point=(*place, 0.0) if place is not None else None,
        distance_m=seen.distance_m,
        distance_sigma_m=seen.sigma_m,
        velocity_mps=seen.velocity_mps,
        seen_by=_seen_by(seen, None),
        measured=seen.measured,
        hits=seen.hits,
        lidar_points=0,
        lidar_track=None,
        vision_track=seen.id,
        gates=gates,
    )


def _seen_by(seen: VisionTrack | None, hit: LidarTrack | None) -> Literal["", "V", "L", "VL"]:
    """The sensors that saw the object in this frame."""
    by_camera, by_lidar = seen is not None and not seen.carried, hit is not None and not hit.carried
    if by_camera and by_lidar:
        return "VL"
    return "V" if by_camera else "L" if by_lidar else ""


def _velocity(seen: VisionTrack | None, hit: LidarTrack) -> Point2 | None:
    """The LiDAR's, or the camera's for the one frame in which the LiDAR has just found what the camera follows: whoever
    brakes for it must not lose its speed then."""
    return hit.velocity_mps if hit.velocity_mps is not None or seen is None else seen.velocity_mps


def _range(track: LidarTrack) -> float:
    """Horizontal range from the ego origin to the cluster's nearest point."""
    return math.hypot(*track.obstacle.closest_point[:2])


def _typical_footprint(near_face: Point2, label: str) -> F64:
    """(4, 2) rectangle of a class's usual size behind a measured nearest face. Its turn is not known: vehicles ahead
    are drawn along ego x."""
    length, width = TYPICAL_SIZE_M.get(label, TYPICAL_SIZE_M["car"])
    x, y = near_face
    return np.array([[x + length, y + width / 2], [x + length, y - width / 2], [x, y - width / 2], [x, y + width / 2]])


def _lidar_sigma(track: LidarTrack) -> float:
    """Standard deviation of a LiDAR track's distance. It grows while the track is carried, by what the tracked speed
    may be off and by what the object may do meanwhile."""
    drift_m = CARRIED_SPEED_SIGMA_MPS * track.unseen_s + CARRIED_ACCEL_SIGMA_MPS2 * track.unseen_s**2 / 2
    return math.hypot(LIDAR_RANGE_SIGMA_M, drift_m)


def _quad(corners: F64) -> tuple[Point2, Point2, Point2, Point2]:
    a, b, c, d = ((x, y) for x, y in corners.tolist())
    return a, b, c, d
