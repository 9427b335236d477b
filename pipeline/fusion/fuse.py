"""Merges LiDAR and vision tracks into one list of objects: V, VL, L (paper, Algorithm 2 and Table 3).

The printed algorithm swaps its indices and emits an "only LiDAR" row for every pair that is not the maximum. This
module implements the intended algorithm: every LiDAR track and every vision track appears in exactly one row, matched
pairs in a common row, so V + VL = vision tracks and L + VL = LiDAR tracks, always.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.alignment.projection import Alignment, project_cuboids
from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64, corners_of, iou_matrix
from pipeline.fusion.rows import box_row, hit_row, lidar_sigma_m, quad, range_m
from pipeline.fusion.vehicle_sizes import LONGEST_M
from pipeline.params import FusionParams
from pipeline.types import Box, FusedObject, Gate, LidarTrack, Mask, Point2, VisionTrack

_SURELY_ONE = 0.5
_KEPT_IOU = 0.2
"""By so much more must another cluster overlap a box than the one that it was joined with: boxes of a VLP-16's few
rings and of a network change by as much from frame to frame."""
_TAKES_OVER_HITS = 2
"""Sightings of a cluster before it may take the place of one that is still there: a spurious one lasts for a sweep."""


@dataclass(frozen=True)
class FusionState:
    """Which fused identity each sensor's track carries, so that an object keeps its number from V to VL to L."""

    next_id: int = 1
    """The number that the next new object gets; numbers are never given twice."""
    by_lidar: dict[int, int] = field(default_factory=dict)
    """Object id of each LiDAR track id, of the last frame."""
    by_vision: dict[int, int] = field(default_factory=dict)
    """Object id of each camera track id, of the last frame."""


@dataclass(frozen=True)
class Fusion:
    """The objects of one frame, and the boxes that fusion compared."""

    objects: tuple[FusedObject, ...]
    """In order of distance."""
    lidar_boxes: dict[int, Box]
    """Projected clusters in image pixels, by object id."""
    vision_boxes: dict[int, Box]
    """Boxes of the camera tracks in image pixels, by object id."""

    def ranged_boxes(self) -> dict[int, tuple[float, float]]:
        """Distance and its standard deviation by the LiDAR, by id of the vision track, of what both surely see now:
        boxes that overlap by less than a half may be those of two vehicles, one beside the other."""
        return {
            item.vision_track: (item.distance_m, item.distance_sigma_m)
            for item in self.objects
            if item.vision_track is not None
            and item.seen_by_two_sensors
            and self._overlap(item.id) >= _SURELY_ONE
            and item.distance_m is not None
            and item.distance_sigma_m is not None
        }

    def _overlap(self, number: int) -> float:
        """IoU of the two boxes of an object that both have; 0 where one has none."""
        hit, seen = self.lidar_boxes.get(number), self.vision_boxes.get(number)
        return float(iou_matrix(np.array([hit]), np.array([seen]))[0, 0]) if hit and seen else 0.0


def fuse(
    state: FusionState,
    lidar: tuple[LidarTrack, ...],
    vision: tuple[VisionTrack, ...],
    alignment: Alignment | None,
    image_size: tuple[int, int] | None,
    params: FusionParams,
) -> tuple[FusionState, Fusion]:
    """One row per physical object. ``image_size`` is (width, height) in pixels; without it or without an alignment
    nothing can be compared, and every track keeps a row of its own."""
    # LiDAR cuboids are projected into the image, where they can be compared with boxes
    corners = corners_of([track.obstacle.cuboid for track in lidar])
    ranges_m, sigmas_m = [range_m(track) for track in lidar], [lidar_sigma_m(track) for track in lidar]
    projected: list[Box | None] = [None] * len(lidar)
    if alignment is not None and image_size is not None:
        projected = project_cuboids(alignment, _to_the_gaps(corners, ranges_m, params), *image_size)
    # What overlaps, agrees in range and has a plausible size may be joined; the best pairs are
    overlap = _overlap(vision, projected)
    were_one = _were_one(state, vision, lidar) & params.keep_partners
    joinable, gates = _gates(overlap, were_one, vision, lidar, ranges_m, sigmas_m, params)
    partner = _assign(overlap + _KEPT_IOU * were_one, joinable, params)
    nearest_of_vision, nearest_of_lidar = _most_overlapping(overlap), _most_overlapping(overlap.T)

    # Every pair, and everything that is alone, is one object, under the id that its tracks had before
    pairs: list[tuple[int | None, int | None]] = [(i, partner.get(i)) for i in range(len(vision))]
    claimed = set(partner.values())
    pairs += [(None, j) for j in range(len(lidar)) if j not in claimed]

    keys = [(vision[i].id if i is not None else None, lidar[j].id if j is not None else None) for i, j in pairs]
    state, ids = _identities(state, keys)
    footprints = corners[:, :4, :2].tolist()
    sides = _box_sides(
        vision, [ranges_m[partner[i]] if i in partner else v.distance_m for i, v in enumerate(vision)], alignment
    )
    objects = []
    for object_id, (i, j) in zip(ids, pairs, strict=True):
        # of an object that one sensor has alone: the tests of the partner it overlaps most, which say why it is alone
        compared = (i if i is not None else nearest_of_lidar[j or 0], j if j is not None else nearest_of_vision[i or 0])
        tested = gates.get(compared, ())
        seen = vision[i] if i is not None else None
        if j is not None:
            footprint = quad(footprints[j])
            row = hit_row(object_id, seen, lidar[j], projected[j], footprint, ranges_m[j], sigmas_m[j], tested)
        elif seen is not None:
            row = box_row(object_id, seen, tested)
        objects.append(evolve(row, box_sides=sides[i]) if i is not None and i in sides else row)
    objects.sort(key=lambda o: (o.distance_m is None, o.distance_m or 0.0, o.id))
    numbered = list(zip(ids, pairs, strict=True))
    lidar_boxes = {number: box for number, (_, j) in numbered if j is not None and (box := projected[j]) is not None}
    vision_boxes = {number: vision[i].bbox for number, (i, _) in numbered if i is not None}
    return state, Fusion(tuple(objects), lidar_boxes, vision_boxes)


def _box_sides(
    vision: tuple[VisionTrack, ...], ranges_m: list[float | None], alignment: Alignment | None
) -> dict[int, tuple[Point2, Point2]]:
    """Vision index → where its box's left and right edge are at its distance, of what the camera sees now. ranges_m: of
    each, the LiDAR's where it has it."""
    seen = [i for i, each in enumerate(vision) if not each.carried and ranges_m[i] is not None]
    if alignment is None or not seen:
        return {}
    boxes = np.array([vision[i].bbox for i in seen])
    middle = (boxes[:, 1] + boxes[:, 3]) / 2
    pixels = np.stack([boxes[:, 0], middle, boxes[:, 2], middle], axis=1).reshape(-1, 2)
    places = (
        alignment.unproject(pixels, np.repeat([ranges_m[i] or 0.0 for i in seen], 2))[:, :2].reshape(-1, 4).tolist()
    )
    return {i: ((ax, ay), (bx, by)) for i, (ax, ay, bx, by) in zip(seen, places, strict=True)}


def _to_the_gaps(corners: F64, ranges_m: list[float], params: FusionParams) -> F64:
    """(M, 8, 3) corners made taller by half the gap between rings at either end: an object's edge lies anywhere between
    the last ring that hit it and the next one that did not. At 25 m a gap is 0.9 m, half a car."""
    margin = np.array(ranges_m) * math.tan(math.radians(params.ring_gap_deg / 2))
    taller = corners.copy()
    taller[:, :4, 2] -= margin[:, None]
    taller[:, 4:, 2] += margin[:, None]
    return taller


def _overlap(vision: tuple[VisionTrack, ...], projected: list[Box | None]) -> F64:
    """(n, m) IoU of vision boxes and projected LiDAR cuboids; zero for a cuboid outside the image."""
    nowhere = (0.0, 0.0, 0.0, 0.0)
    return iou_matrix(np.array([v.bbox for v in vision]), np.array([box or nowhere for box in projected]))


def _were_one(state: FusionState, vision: tuple[VisionTrack, ...], lidar: tuple[LidarTrack, ...]) -> Mask:
    """(n, m) bool: the pairs that were one object in the last frame."""
    hits = np.array([state.by_lidar.get(each.id, -1) for each in lidar])
    seen = np.array([state.by_vision.get(each.id, -2) for each in vision])
    return np.asarray(seen[:, None] == hits[None])


def _gates(
    overlap: F64,
    were_one: Mask,
    vision: tuple[VisionTrack, ...],
    lidar: tuple[LidarTrack, ...],
    ranges_m: list[float],
    sigmas_m: list[float],
    params: FusionParams,
) -> tuple[np.ndarray, dict[tuple[int, int], tuple[Gate, ...]]]:
    """Which pairs may be one object, and the tests each overlapping pair went through. were_one: as ``_were_one`` gives
    it. ranges_m, sigmas_m: of the LiDAR tracks."""
    is_held = np.any(were_one & np.array([not each.carried for each in lidar], dtype=np.bool_), axis=1).tolist()
    lengths_m = [max(track.obstacle.cuboid.size[:2]) for track in lidar]
    joinable = np.zeros(overlap.shape, dtype=bool)
    gates: dict[tuple[int, int], tuple[Gate, ...]] = {}
    rows, columns = np.nonzero(overlap > 0)
    for i, j, iou in zip(rows.tolist(), columns.tolist(), overlap[rows, columns].tolist(), strict=True):
        tests = [Gate("iou", iou, params.min_iou, iou >= params.min_iou)]
        distance, sigma = vision[i].distance_m, vision[i].sigma_m
        # boxes of nearly one place and size are one object: there it is the height law that errs, not the LiDAR
        doubtful = params.range_gate and iou < params.sure_iou
        if doubtful and distance is not None and sigma is not None:
            gap = abs(distance - ranges_m[j]) / math.hypot(sigma, sigmas_m[j])
            tests.append(Gate("range_sigmas", gap, params.range_gate_sigmas, gap <= params.range_gate_sigmas))
        longest_m = LONGEST_M.get(vision[i].label) if params.size_gate else None
        if longest_m is not None:
            tests.append(Gate("class_size", lengths_m[j], longest_m, lengths_m[j] <= longest_m))
        if is_held[i] and not were_one[i, j]:
            hits = lidar[j].hits
            tests.append(Gate("cluster_hits", hits, _TAKES_OVER_HITS, hits >= _TAKES_OVER_HITS))
        joinable[i, j] = all(test.passed for test in tests)
        gates[i, j] = tuple(tests)
    return joinable, gates


def _most_overlapping(overlap: F64) -> list[int]:
    """For each row the column that it overlaps most, the first of equals; empty where there are no columns."""
    return overlap.argmax(axis=1).tolist() if overlap.shape[1] else [0] * len(overlap)


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
