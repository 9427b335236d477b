"""Estimates whether an object exists: the evidence of each sensor for and against it, as log-odds of existence.

For: a camera box counts according to how often boxes with its score were correct; a LiDAR cluster counts a lot.
Against: LiDAR rays that passed through the position at the height of a car's body (``free_road``). If a working LiDAR
looks through a position, nothing stands there, however certain a box is. Images in which a working camera must have
seen what a cluster is, without a box on it (``unseen``): it is there, but it is not a vehicle.

A sensor that could not observe the object gives no evidence: no ray passed at that height, or something nearer stopped
it. Evidence is not accumulated without limit either: ten consecutive boxes of one network on one wall count hardly more
than one, so the camera's log-odds are those of its running mean score; only the LiDAR's are summed, between bounds. A
missing box counts as a score of zero, the more so the shorter the object has been tracked: a burst of false boxes ends
as suddenly as it began.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from pipeline.common.fast_replace import evolve
from pipeline.fusion.free_road import CLEAR_SHARE, MIN_RAYS, NEAR_M, Rays, SweepRays, rays_to
from pipeline.fusion.last_place import LastPlace, is_elsewhere, last_place
from pipeline.fusion.unseen import missing_boxes, never_boxed
from pipeline.params import ExistenceParams
from pipeline.types import Frame, FusedObject, Gate, Moment
from pipeline.types.sensors import further_sensors

SURE = 4.0
"""Limit of the log-odds of each sensor and of their sum, 98 %: without it, evidence of long ago would outweigh that of
the last few sweeps."""
_EVEN_SCORE, _SCORE_SLOPE = 0.45, 8.5
"""Score at which a box is a vehicle with probability 0.5, and growth of the log-odds per 1.0 of score. Logistic fit to
1,473 boxes of YOLOX-nano on Astyx and KITTI, compared with labelled vehicles. Leaving out any one of the four
recordings gives 0.40 to 0.52 and 7.7 to 10.1."""
_MEAN_S, _LONGEST_MEAN_S = 0.5, 2.0
"""Time constants of the running mean of scores: for boxes, and the longest for missing boxes. For missing boxes it is
the time since the object was first seen, between these two. False boxes of YOLOX-nano on Astyx and KITTI come in bursts
of one to four images; an object that was seen for two seconds has merely been missed."""
_ALONG, _ALONG_AFTER_M, _ALONG_SHARE = 2.0, 25.0, 0.5
"""Log-odds added for an object that moves along with the car; the distance driven after which that can be judged; and
the share of it by which the object's distance has then shrunk at most. False boxes lie on static structures, which come
nearer by every metre that the car drives. At 50 m the distance from a box varies by 7 % from image to image, so half of
25 m is more than two standard deviations of a difference."""
_FIRST_SIGMAS, _IMAGE_SHARE = 3.0, 0.1
"""A static object comes nearer by the distance driven. If one came nearer by more than that and this many standard
deviations of a difference of two distances (the share: 7 % from image to image, times √2), then its first distance was
wrong, or it is oncoming; either way it is judged from here on. Otherwise one false box at 160 m would exclude for 200 m
of driving that a car at 60 m drives ahead."""
_UNBOXED, _LOOKS = -1.3, 3
"""Log-odds added for each image in which the camera must have seen what the LiDAR tracks and no box was on it, up to
this number of images; void with the first box. Of confirmed clusters as large as a vehicle, on Astyx and KITTI, 48 of
48 on labelled vehicles had been boxed after three sightings, and 8 of 109 others. Of those sighted once or twice 12 of
113 and 337 of 363 had no box, a log-likelihood ratio of -2.2. Without the LiDAR's evidence for it, such a cluster is a
wall, a tree or a hedge; with it, it counts as a half."""
_EMPTY_S = 1.0
"""Time constant for forgetting that rays passed through the object's position: ten images at 10 Hz, in which the camera
measures the position again."""
_CLUSTER, _RETURNS, _PIERCED, _SILENT, _TAKEN = 2.0, 1.0, -3.0, -2.0, -2.0
"""Log-odds added by one sweep, in this order: a cluster on the object; single returns that range it; rays that passed
through it; rays without a return; close to the car, rays that ended there but in the cluster of another object. Rays
that ended somewhere in the range that a box leaves open say nothing: that happened to 4 of 154 boxes on labelled
vehicles without a cluster, and to 4 of 284 other boxes, on Astyx and KITTI.
Of 394 labelled vehicles within 30 m in 126 frames of a VLP-16, with the position uncertainty of a box, none was passed
through and 6 returned no rays; with the smallest position uncertainty, none and 10. The values are lower than these
counts suggest, because successive sweeps are not independent."""
_FOLLOWED_S = 0.5
"""A box may match a neighbour's cluster for a few sweeps; an object that had a cluster for longer than this (five
sweeps at 10 Hz) was really seen by the LiDAR."""


class Existence(NamedTuple):
    """Evidence about one object from earlier frames."""

    score: float | None
    """Running mean of its boxes' scores; None before the first box."""
    lidar: float
    """Log-odds of the LiDAR and of other ranging sensors."""
    last: LastPlace | None = None
    """Where it was."""
    age_s: float = 0.0
    """Time since it was first seen."""
    from_m: float | None = None
    """Its distance when the camera's position was initialised; None before that."""
    travelled_m: float = 0.0
    """Distance driven by the car since then."""
    judged_m: float = 0.0
    """The part of it that was driven until its distance was last measured."""
    shrunk_m: float = 0.0
    """Decrease of its distance meanwhile."""
    cluster_s: float = 0.0
    """Total time that the LiDAR has seen it."""
    unboxed: int = 0
    """Number of images in which the camera must have seen it, while no box was ever on it; at most ``_LOOKS``."""

    @property
    def goes_along(self) -> bool:
        """Whether its distance has shrunk by less than that of a static object would have: see ``_ALONG``."""
        return self.judged_m >= _ALONG_AFTER_M and self.shrunk_m < _ALONG_SHARE * self.judged_m


@dataclass(frozen=True)
class ExistenceState:
    """Evidence about the existence of each object."""

    known: dict[int, Existence] = field(default_factory=dict)
    """By object id."""
    by_vision: dict[int, int] = field(default_factory=dict)
    """Object id of each vision track."""
    cluster_of: dict[int, int] = field(default_factory=dict)
    """By object id, the last LiDAR track that was its own."""
    looks_far: bool = False
    """Whether far parts of images are processed a second time, at least in some frames."""


def weigh(
    state: ExistenceState,
    objects: tuple[FusedObject, ...],
    sweep: SweepRays,
    frame: Frame,
    now: Moment,
    params: ExistenceParams,
) -> tuple[ExistenceState, tuple[FusedObject, ...]]:
    """The objects with their ``existence`` and, if rays give evidence, a gate that shows it.

    frame: the frame of these objects.
    """
    if not params.enabled:
        return ExistenceState(), objects
    rays = rays_to(objects, sweep)
    seen = frame.raw_boxes
    looks_far = state.looks_far or (seen is not None and seen.far is not None)
    # in frames without a far view, far objects may be missing for that reason
    looked = seen is not None and (seen.far is not None or not looks_far)
    missed = missing_boxes(objects, frame) if looked else frozenset()
    unboxed = never_boxed(objects, frame) if looked and params.use_missing_boxes else frozenset()
    known: dict[int, Existence] = {}
    judged = []
    cluster_of = {item.id: state.cluster_of[item.id] for item in objects if item.id in state.cluster_of}
    cluster_of |= {item.id: item.lidar_track for item in objects if item.lidar_track is not None}
    seen_clusters = {item.lidar_track for item in objects if item.seen_by_lidar}
    for item in objects:
        before = _before(state, item)
        is_left = item.lidar_track is None and cluster_of.get(item.id) in seen_clusters
        found = _updated(before, item, rays.get(item.id), item.id in missed, is_left, now, params)
        if item.id in unboxed:
            found = found._replace(unboxed=min(found.unboxed + 1, _LOOKS))
        known[item.id] = found
        camera = _said_by_camera(found)
        odds = _bounded(_bounded(camera) + found.lidar)
        judged.append(_told(item, 1.0 / (1.0 + math.exp(-odds)), rays.get(item.id), found.unboxed))
    by_vision = {item.vision_track: item.id for item in objects if item.vision_track is not None}
    return ExistenceState(known, by_vision, cluster_of, looks_far), tuple(judged)


def _before(state: ExistenceState, item: FusedObject) -> Existence:
    """Evidence about an object until now. If its id went to another part of it, its boxes are still the same: what they
    said, and what the LiDAR said against them, still holds. What it said for them was about the other part, and it was
    the other part that it followed."""
    known = state.known.get(item.id)
    if known is None and item.vision_track in state.by_vision:
        before = state.known[state.by_vision[item.vision_track]]
        known = before._replace(lidar=min(before.lidar, 0.0), cluster_s=0.0)
    return known if known is not None else Existence(None, 0.0)


def _updated(
    before: Existence,
    item: FusedObject,
    rays: Rays | None,
    missed: bool,
    is_left: bool,
    now: Moment,
    params: ExistenceParams,
) -> Existence:
    """is_left: its former cluster is another object now."""
    dt_s = now.dt_s or 0.0
    score, lidar, age_s = before.score, before.lidar, before.age_s + dt_s
    if item.seen_by_camera and item.score is not None:
        score = item.score if score is None else score + _weight(dt_s, _MEAN_S) * (item.score - score)
    elif missed and score is not None:
        score -= _weight(dt_s, min(max(age_s, _MEAN_S), _LONGEST_MEAN_S)) * score
    moved = is_elsewhere(item, before.last, params.forget_at_takeover)
    if moved:
        lidar = 0.0  # what the LiDAR saw at one place says nothing about another
    elif lidar < 0.0:
        lidar *= math.exp(-dt_s / _EMPTY_S)  # the object moves on
    from_m, travelled_m, judged_m, shrunk_m = before.from_m, before.travelled_m, before.judged_m, before.shrunk_m
    if moved or from_m is None or now.speed_mps is None:
        from_m, travelled_m, judged_m, shrunk_m = item.distance_m, 0.0, 0.0, 0.0
    else:
        travelled_m += now.speed_mps * dt_s
        if item.measured and item.distance_m is not None:
            judged_m, shrunk_m = travelled_m, from_m - item.distance_m
            if shrunk_m > judged_m + _FIRST_SIGMAS * _IMAGE_SHARE * item.distance_m:
                from_m, travelled_m, judged_m, shrunk_m = item.distance_m, 0.0, 0.0, 0.0
    cluster_s = before.cluster_s + (dt_s if item.seen_by_lidar else 0.0)
    may_be_merged = cluster_s >= _FOLLOWED_S and not is_left
    lidar = _bounded(lidar + _said_by_lidar(item, rays, may_be_merged) + _said_by_others(item))
    return Existence(
        score, lidar, last_place(item), age_s, from_m, travelled_m, judged_m, shrunk_m, cluster_s, before.unboxed
    )


def _said_by_camera(found: Existence) -> float:
    """Log-odds of the camera, from all images so far."""
    boxes = (found.score - _EVEN_SCORE) * _SCORE_SLOPE if found.score is not None else _UNBOXED * found.unboxed
    return boxes + (_ALONG if found.goes_along else 0.0)


def _weight(dt_s: float, mean_s: float) -> float:
    """Weight of one frame in a running mean."""
    return 1.0 - math.exp(-dt_s / mean_s)


def _said_by_lidar(item: FusedObject, rays: Rays | None, may_be_merged: bool) -> float:
    """Log-odds added by this sweep. If the LiDAR has tracked the object and its returns now belong to another cluster,
    the two clusters have merged; if the LiDAR never tracked it, it is a second box on the neighbour. If its own cluster
    goes on as another object, the vehicle is there, and its box is misplaced: that of a truck that overtakes, most of
    which the image's edge cuts off."""
    if item.seen_by_lidar:
        return _CLUSTER
    if item.returns >= MIN_RAYS:  # others passed over it: beyond a crest, the road is lower than it seems
        return _RETURNS
    if rays is not None and rays.is_free:
        return _PIERCED
    if item.returns:
        return _RETURNS
    if rays is None:
        return 0.0
    if rays.is_silent:
        return _SILENT
    is_near = (item.distance_m or 0.0) < NEAR_M
    return _TAKEN if is_near and rays.is_taken and not may_be_merged else 0.0


def _said_by_others(item: FusedObject) -> float:
    """Log-odds added by the sightings of further ranging sensors in this frame."""
    return sum([kind.sighting_odds for kind in further_sensors() if kind.letter in item.seen_by])


def _told(item: FusedObject, probability: float, rays: Rays | None, unboxed: int) -> FusedObject:
    """The object with its probability and the gates for the evidence from rays and from missing boxes."""
    found: list[Gate] = []
    if rays is not None and (share := rays.free_share) is not None:
        found.append(Gate("free_road", share, CLEAR_SHARE, not (rays.is_free or rays.is_silent)))
    if rays is not None and rays.taken >= MIN_RAYS and (item.distance_m or 0.0) < NEAR_M:
        found.append(Gate("own_returns", rays.stopped, MIN_RAYS, rays.is_stopped))
    if unboxed and not item.imaged:
        found.append(Gate("images_without_box", unboxed, _LOOKS - 1, unboxed < _LOOKS))
    return evolve(item, existence=probability, gates=(*item.gates, *found))


def _bounded(odds: float) -> float:
    return min(max(odds, -SURE), SURE)
