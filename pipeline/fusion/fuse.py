"""Merges the tracks of all sensors into one list of objects: V, VL, L (paper, Algorithm 2 and Table 3).

The printed algorithm swaps its indices and emits an "only LiDAR" row for every pair that is not the maximum. This
module implements the intended algorithm: every LiDAR track and every vision track appears in exactly one row, matched
pairs in a common row, so V + VL = vision tracks and L + VL = LiDAR tracks, always. Tracks of further ranging sensors
join these rows by their place, or get a row of their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.alignment.projection import Alignment, project_cuboids
from pipeline.common.geometry import F64, corners_of, iou_matrix
from pipeline.fusion.last_place import AGREEMENT_SIGMAS
from pipeline.fusion.ranged_rows import TrackIndices, ranged_row, with_ranged
from pipeline.fusion.rows import L, V, box_row, hit_row, lidar_sigma_m, quad, range_m
from pipeline.fusion.vehicle_sizes import LONGEST_M
from pipeline.params import FusionParams
from pipeline.ranging.further import Tracks
from pipeline.types import VEHICLES, Box, FusedObject, Gate, LidarTrack, Mask, Point2, RangedTrack, VisionTrack

_SURELY_ONE = 0.5
"""Horizontal overlap of cluster and box from which they are surely one vehicle: see ``Fusion.ranged_boxes``."""
_KEPT_IOU = 0.2
"""Another cluster must overlap a box by this much more than the one it was joined with: with a VLP-16's few rings,
overlaps vary by as much from frame to frame."""
NO_TRACKS: Tracks = {}
_TAKES_OVER_HITS = 2
"""Sightings of a cluster before it may replace one that still exists, or contradict the camera: a spurious cluster
lasts for one sweep."""
_LONG_FRAMES = 10
"""A track that has belonged to an object for this many frames in a row, a second at 10 Hz, was not joined to it by
chance."""
_SETTLED_RANGES = 3
"""Distances of a camera track, after which a single cluster does not contradict it."""


class Owner(NamedTuple):
    """The object that a track belongs to."""

    id: int
    """Of the object."""
    frames: int = 1
    """Number of frames in a row."""


@dataclass(frozen=True)
class FusionState:
    """Object id of each sensor's tracks, so that an object keeps its id when it changes from VL to V or L."""

    next_id: int = 1
    """Id of the next new object; ids are never reused."""
    owners: Mapping[str, Mapping[int, Owner]] = field(default_factory=dict)
    """The object of each track id in the last frame, by the sensor's letter."""

    def owner_of(self, letter: str, track: int) -> Owner | None:
        """The object of a sensor's track in the last frame; None for a new track."""
        return self.owners.get(letter, {}).get(track)


@dataclass(frozen=True)
class Fusion:
    """The objects of one frame, and the boxes that fusion compared."""

    objects: tuple[FusedObject, ...]
    """In order of distance."""
    lidar_boxes: dict[int, Box]
    """Projected clusters in image pixels, by object id."""
    vision_boxes: dict[int, Box]
    """Boxes of the camera tracks in image pixels, by object id."""
    bereft: Mapping[int, tuple[int, float]] = field(default_factory=dict)
    """Camera tracks that are seen alone now, while the cluster that they were one object with goes on with another box:
    one of the two boxes was, or is, that of another vehicle. By track id: id of the other box's track, and the
    cluster's range in metres."""

    def ranged_boxes(self) -> dict[int, tuple[float, float]]:
        """LiDAR distance and its standard deviation, by id of the vision track, for objects that both sensors surely
        see now: boxes that overlap by less than a half across may belong to two vehicles side by side. Their heights
        prove nothing, because a few rings see a part of a vehicle, and pitch shifts it."""
        return {
            item.vision_track: (item.distance_m, item.distance_sigma_m)
            for item in self.objects
            if item.vision_track is not None
            and item.seen_by_two_sensors
            and self._overlap_across(item.id) >= _SURELY_ONE
            and item.distance_m is not None
            and item.distance_sigma_m is not None
        }

    def _overlap_across(self, number: int) -> float:
        """Horizontal overlap of an object's two boxes, as a share of both together; 0 if one is missing."""
        hit, seen = self.lidar_boxes.get(number), self.vision_boxes.get(number)
        if hit is None or seen is None:
            return 0.0
        common, both = min(hit[2], seen[2]) - max(hit[0], seen[0]), max(hit[2], seen[2]) - min(hit[0], seen[0])
        return max(common, 0.0) / both if both > 0.0 else 0.0


def fuse(
    state: FusionState,
    lidar: tuple[LidarTrack, ...],
    vision: tuple[VisionTrack, ...],
    alignment: Alignment | None,
    image_size: tuple[int, int] | None,
    params: FusionParams,
    ranged: Tracks = NO_TRACKS,
) -> tuple[FusionState, Fusion]:
    """One row per physical object. ``image_size`` is (width, height) in pixels; without it or without an alignment
    boxes and clusters cannot be compared, and each gets its own row. ranged: tracks of further ranging sensors, by
    letter."""
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
    rows: list[TrackIndices] = [{V: i, L: partner[i]} if i in partner else {V: i} for i in range(len(vision))]
    claimed = set(partner.values())
    rows += [{L: j} for j in range(len(lidar)) if j not in claimed]
    if ranged:
        rows = with_ranged(rows, vision, lidar, ranged)
    tracks: dict[str, Sequence[LidarTrack | VisionTrack | RangedTrack]] = {V: vision, L: lidar, **ranged}
    keys = [{letter: tracks[letter][place].id for letter, place in row.items()} for row in rows]
    is_seen = [any(not tracks[letter][place].carried for letter, place in row.items()) for row in rows]
    state, ids = _identities(state, keys, is_seen)

    footprints = corners[:, :4, :2].tolist()
    sides = _box_sides(
        vision, [ranges_m[partner[i]] if i in partner else v.distance_m for i, v in enumerate(vision)], alignment
    )
    objects: list[FusedObject] = []
    for object_id, row in zip(ids, rows, strict=True):
        item: FusedObject | None = None
        i, j = row.get(V), row.get(L)
        seen = vision[i] if i is not None else None
        side = sides.get(i) if i is not None else None
        # for an object seen by only one of the two: the tests of the partner with the largest overlap, which explain
        # why they were not joined
        if j is not None:
            tested = gates.get((i if i is not None else nearest_of_lidar[j], j), ())
            item = hit_row(
                object_id, seen, lidar[j], projected[j], quad(footprints[j]), ranges_m[j], sigmas_m[j], tested, side
            )
        elif i is not None and seen is not None:
            item = box_row(object_id, seen, gates.get((i, nearest_of_vision[i]), ()), side)
        if ranged or item is None:
            item = ranged_row(object_id, item, row, ranged)
        objects.append(item)
    numbered = list(zip(ids, rows, strict=True))
    lidar_boxes = {number: box for number, row in numbered if L in row and (box := projected[row[L]]) is not None}
    vision_boxes = {number: vision[row[V]].bbox for number, row in numbered if V in row}
    bereft = _bereft(were_one, vision, partner, ranges_m)
    return state, Fusion(_nearest_first(objects), lidar_boxes, vision_boxes, bereft)


def _bereft(
    were_one: Mask, vision: tuple[VisionTrack, ...], partner: Mapping[int, int], ranges_m: list[float]
) -> dict[int, tuple[int, float]]:
    """As ``Fusion.bereft``."""
    taken = {j: i for i, j in partner.items() if not vision[i].carried}
    return {
        each.id: (vision[taken[j]].id, ranges_m[j])
        for i, each in enumerate(vision)
        if i not in partner and not each.carried
        for j in np.flatnonzero(were_one[i]).tolist()
        if j in taken
    }


def _nearest_first(objects: list[FusedObject]) -> tuple[FusedObject, ...]:
    return tuple(sorted(objects, key=lambda o: (o.distance_m is None, o.distance_m or 0.0, o.id)))


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
    hits = np.array([owner.id if (owner := state.owner_of(L, each.id)) else -1 for each in lidar])
    seen = np.array([owner.id if (owner := state.owner_of(V, each.id)) else -2 for each in vision])
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
        distance, sigma, was_one = vision[i].distance_m, vision[i].sigma_m, bool(were_one[i, j])
        if params.range_gate and distance is not None and sigma is not None:
            gap = abs(distance - ranges_m[j]) / math.hypot(sigma, sigmas_m[j])
            # boxes of nearly the same place and size are one object: then the height law is wrong, not the LiDAR
            if iou + _KEPT_IOU * was_one < params.sure_iou:
                tests.append(Gate("range_sigmas", gap, params.range_gate_sigmas, gap <= params.range_gate_sigmas))
            elif params.settled_boxes and lidar[j].hits < _TAKES_OVER_HITS and vision[i].ranges >= _SETTLED_RANGES:
                tests.append(Gate("range_sigmas", gap, AGREEMENT_SIGMAS, gap <= AGREEMENT_SIGMAS))
        longest_m = LONGEST_M.get(vision[i].label) if params.size_gate else None
        if longest_m is not None:
            tests.append(Gate("class_size", lengths_m[j], longest_m, lengths_m[j] <= longest_m))
        if is_held[i] and not was_one:
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


def _identities(state: FusionState, keys: list[dict[str, int]], is_seen: list[bool]) -> tuple[FusionState, list[int]]:
    """The object id of each row. keys: the track id of each of its sensors, by letter. is_seen: whether a sensor
    measures it now.

    A row inherits an id of its tracks that is not yet taken: that which one of them has had for longest, so that a
    track that another object had for a moment does not bring that object's id; of several, the oldest. Rows of
    more sensors choose first, so that a single fragment never takes over the id of a whole object; then those that are
    seen and have had their id for long: a vehicle that leaves the image keeps its id where the LiDAR follows it, not
    where its box was expected."""
    before = [[state.owner_of(letter, track) for letter, track in key.items()] for key in keys]
    is_followed = [
        seen and any(owner is not None and owner.frames >= _LONG_FRAMES for owner in owners)
        for seen, owners in zip(is_seen, before, strict=True)
    ]
    order = sorted(range(len(keys)), key=lambda k: (-len(keys[k]), not is_followed[k], k))
    ids = [0] * len(keys)
    taken: set[int] = set()
    next_id = state.next_id
    for k in order:
        known = [(-owner.frames, owner.id) for owner in before[k] if owner is not None and owner.id not in taken]
        ids[k] = min(known)[1] if known else next_id
        next_id += not known
        taken.add(ids[k])
    owners: dict[str, dict[int, Owner]] = {}
    for object_id, key in zip(ids, keys, strict=True):
        for letter, track in key.items():
            last = state.owner_of(letter, track)
            frames = last.frames + 1 if last is not None and last.id == object_id else 1
            owners.setdefault(letter, {})[track] = Owner(object_id, frames)
    return FusionState(next_id, owners), ids
