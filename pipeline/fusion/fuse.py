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
from pipeline.common.geometry import F64, corners_of, iou_matrix
from pipeline.fusion.rows import box_row, hit_row, lidar_sigma_m, quad, range_m
from pipeline.fusion.vehicle_sizes import LONGEST_M
from pipeline.params import FusionParams
from pipeline.types import VEHICLES, Box, FusedObject, Gate, LidarTrack, Mask, Point2, VisionTrack

_SURELY_ONE = 0.5
_KEPT_IOU = 0.2
"""Another cluster must overlap a box by this much more than the one it was joined with: with a VLP-16's few rings,
overlaps vary by as much from frame to frame."""
_TAKES_OVER_HITS = 2
"""Sightings of a cluster before it may replace one that still exists: a spurious cluster lasts for one sweep."""


@dataclass(frozen=True)
class FusionState:
    """Object id of each sensor's tracks, so that an object keeps its id when it changes from VL to V or L."""

    next_id: int = 1
    """Id of the next new object; ids are never reused."""
    by_lidar: dict[int, int] = field(default_factory=dict)
    """Object id of each LiDAR track id, in the last frame."""
    by_vision: dict[int, int] = field(default_factory=dict)
    """Object id of each camera track id, in the last frame."""


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
        """LiDAR distance and its standard deviation, by id of the vision track, for objects that both sensors surely
        see now: boxes that overlap by less than a half may belong to two vehicles side by side."""
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
        """IoU of an object's two boxes; 0 if one is missing."""
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
    nothing can be compared, and every track gets its own row."""
    # LiDAR cuboids are projected into the image to compare them with boxes
    corners = corners_of([track.obstacle.cuboid for track in lidar])
    ranges_m, sigmas_m = [range_m(track) for track in lidar], [lidar_sigma_m(track) for track in lidar]
    projected: list[Box | None] = [None] * len(lidar)
    if alignment is not None and image_size is not None:
        projected = project_cuboids(alignment, _to_the_gaps(corners, ranges_m, params), *image_size)
    # Pairs that overlap, agree in range and have a plausible size may be joined; the best pairs are
    overlap = _overlap(vision, projected)
    were_one = _were_one(state, vision, lidar) & params.keep_partners
    joinable, gates = _gates(overlap, were_one, vision, lidar, ranges_m, sigmas_m, params)
    partner = _assign(overlap + _KEPT_IOU * were_one, joinable, params)
    nearest_of_vision, nearest_of_lidar = _most_overlapping(overlap), _most_overlapping(overlap.T)

    # Every pair and every unmatched track is one object, under the id that its tracks had before
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
        # for an object seen by only one sensor: the tests of the partner with the largest overlap, which explain why
        # they were not joined
        compared = (i if i is not None else nearest_of_lidar[j or 0], j if j is not None else nearest_of_vision[i or 0])
        tested = gates.get(compared, ())
        seen = vision[i] if i is not None else None
        side = sides.get(i) if i is not None else None
        if j is not None:
            footprint = quad(footprints[j])
            objects.append(
                hit_row(object_id, seen, lidar[j], projected[j], footprint, ranges_m[j], sigmas_m[j], tested, side)
            )
        elif seen is not None:
            objects.append(box_row(object_id, seen, tested, side))
    objects.sort(key=lambda o: (o.distance_m is None, o.distance_m or 0.0, o.id))
    numbered = list(zip(ids, pairs, strict=True))
    lidar_boxes = {number: box for number, (_, j) in numbered if j is not None and (box := projected[j]) is not None}
    vision_boxes = {number: vision[i].bbox for number, (i, _) in numbered if i is not None}
    return state, Fusion(tuple(objects), lidar_boxes, vision_boxes)


def _box_sides(
    vision: tuple[VisionTrack, ...], ranges_m: list[float | None], alignment: Alignment | None
) -> dict[int, tuple[Point2, Point2]]:
    """Vision index → position of the box's left and right edge at its distance, for boxes seen in this frame. ranges_m:
    of each box, from the LiDAR if available."""
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
    """(M, 8, 3) corners extended at the top and bottom by half the gap between rings: an object's edge lies anywhere
    between the last ring that hit it and the next one that did not. At 25 m a gap is 0.9 m, half a car."""
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
    """Which pairs may be one object, and the tests of each overlapping pair. were_one: as returned by ``_were_one``.
    ranges_m, sigmas_m: of the LiDAR tracks."""
    is_held = np.any(were_one & np.array([not each.carried for each in lidar], dtype=np.bool_), axis=1).tolist()
    # a cluster whose vehicle is still boxed is no suitcase, even if such a box fits it better in this image
    boxed = np.array([_is_boxed_vehicle(each) for each in vision], dtype=np.bool_)
    has_vehicle = np.any(were_one & boxed[:, None], axis=0).tolist()
    lengths_m = [max(track.obstacle.cuboid.size[:2]) for track in lidar]
    joinable = np.zeros(overlap.shape, dtype=bool)
    gates: dict[tuple[int, int], tuple[Gate, ...]] = {}
    rows, columns = np.nonzero(overlap > 0)
    for i, j, iou in zip(rows.tolist(), columns.tolist(), overlap[rows, columns].tolist(), strict=True):
        tests = [Gate("iou", iou, params.min_iou, iou >= params.min_iou)]
        distance, sigma = vision[i].distance_m, vision[i].sigma_m
        # boxes of nearly the same place and size are one object: then the height law is wrong, not the LiDAR
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
        if has_vehicle[j] and vision[i].label not in VEHICLES:
            tests.append(Gate("same_kind", None, 1.0, False))
        joinable[i, j] = all(test.passed for test in tests)
        gates[i, j] = tuple(tests)
    return joinable, gates


def _is_boxed_vehicle(track: VisionTrack) -> bool:
    """Whether the camera sees it now and names it a vehicle."""
    return track.label in VEHICLES and not track.carried


def _most_overlapping(overlap: F64) -> list[int]:
    """For each row, the column with the largest overlap, the first one if several are equal; empty without columns."""
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
    """The object id of each (vision track, LiDAR track) row. A row inherits the oldest id of its tracks that is not yet
    taken; pairs choose first, so that a single fragment never takes over the id of a whole object."""
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
