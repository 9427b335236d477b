"""Turns the pipeline's results for a drive into label proposals.

Half of the objects are roadside returns and not worth a look. Proposed are objects that the camera classifies as road
users, and objects that certainly drove over the ground and are as large as a vehicle, each with a confidence. A track
ends at its last sighting, not at its last prediction; between two sightings, predictions are used. A cluster larger
than any vehicle of its class is a vehicle with something beside it, or no vehicle: its position is meaningless, and
only its box is kept. The same applies to objects seen in only one frame, because a cluster under a box is then just as
often a pole.

The lead is proposed where the pipeline chose an object that is proposed. Otherwise, ``none`` is proposed only if a
vehicle in the path would have been detected up to ``FARTHEST_LEAD_M``; else the lead is unclear.

Objects that only the camera sees are proposed as a box in the image, without a cuboid. A cuboid from the height of the
box, as ``pipeline.labels.cuboid_from_pixel`` creates, was tried: on Astyx its centre was 14 m off (median of 55 with
ground truth, at 68 m), and two in three did not even touch the vehicle; and a distance that nobody measured must not
become the ground truth for scoring distances.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.common.geometry import Cuboid, iou_matrix
from pipeline.fusion.vehicle_sizes import largest_size_m, usual_size_m
from pipeline.labels.headings import Moment, Pose, faced, guessed, oncoming_side, own_poses, travelled
from pipeline.labels.interpolate import resized
from pipeline.labels.model import FARTHEST_LEAD_M, LabelTrack, Lead, LeadRange, Origin, Sighting
from pipeline.types import VEHICLES, Box

ROAD_USERS = VEHICLES | {"person", "bicycle"}
NAMELESS = "car"
"""Class of objects seen only by the LiDAR; the most common one."""
_SAME_M = 2.0
_SAME_IOU = 0.4
_SAME_SHARE = 0.5
_LARGE = 0.9
"""Quantile of a track's sightings used as its size: single ones include neighbouring objects."""
_FEWEST = 2
"""Objects seen only once are mostly noise and are not proposed."""
_FEWEST_STEPS = 5
"""Half a second at 10 Hz: over a shorter time, even a cluster that flickers along a wall seems to move."""
_NARROWEST_M, _LOWEST_M = 1.2, 0.5
"""Visible rear of the smallest car: 1.4 m wide at the bumper (kei cars: 1.48 m), minus a beam's spacing."""
_RIGID, _ONE_BODY = 0.25, 0.5
"""The visible extent of a rigid body changes slowly from sweep to sweep. If it varies by more than half (standard
deviation of height or longest side over the median), the track switched between bodies and its motion is not valid;
below a quarter it is one body, even without a camera. Measured on Astyx: 0.04 to 0.19 on vehicles seen often, 0.4 and
more on flickering walls and hedges, 0.8 for a track that jumped from car to car."""
_NAMELESS_WEIGHT = 0.5
"""A moving object without a class may or may not be a vehicle; there is no further evidence."""
_OVER = 1.25
"""Factor by which a cluster may be wider or taller than the largest vehicle of its class: an open door, a branch."""


@dataclass(frozen=True)
class Seen:
    """An object of one frame's result."""

    id: int
    """Object id in the run."""
    label: str | None
    """The camera's class; None if only the LiDAR has seen it."""
    cuboid: Cuboid | None
    """In the ego frame; None without a LiDAR cluster."""
    bbox: Box | None
    """In image pixels; None without a camera track."""
    in_path: bool
    """Whether it was in the ego path in the run."""
    carried: bool
    """Predicted instead of seen in this frame."""
    score: float | None = None
    """The detector's score of its class, 0–1; None if the camera does not see it."""


@dataclass(frozen=True)
class Proposals:
    """Tracks under the run's own ids, and leads."""

    tracks: tuple[LabelTrack, ...]
    """Vehicles, one per object that was seen often enough."""
    leads: tuple[LeadRange, ...]
    """The leads of the run; ranges do not overlap."""


def propose(
    frames: Mapping[int, Sequence[Seen]],
    leads: Mapping[int, int | None],
    origin: Origin,
    moments: Mapping[int, Moment] | None = None,
) -> Proposals:
    """Tracks and leads from a run.

    Args:
        frames: objects seen in each frame, by index.
        leads: the CIPV's id in each frame, None for none.
        origin: of the proposals.
        moments: own motion at each frame. Without it, no object is known to move, and no frame to be empty.
    """
    by_id: dict[int, dict[int, Seen]] = {}
    for index in sorted(frames):
        for seen in frames[index]:
            by_id.setdefault(seen.id, {})[index] = seen
    poses = own_poses(moments or {})
    found = [
        track for number, life in sorted(by_id.items()) if (track := _track(number, life, poses, origin)) is not None
    ]
    side = oncoming_side((track.sightings, track.heading) for track in found)
    tracks = tuple(
        replace(track, sightings=guessed(track.sightings, side)) if track.heading == "unknown" else track
        for track in found
    )
    kept = {track.id for track in tracks}
    who = {index: _lead(lead, kept, frames.get(index, ()), (moments or {}).get(index)) for index, lead in leads.items()}
    return Proposals(tracks, tuple(_ranges(who, origin)))


def known_as(proposals: Sequence[LabelTrack], known: Sequence[LabelTrack]) -> dict[int, int]:
    """Proposals that match labelled vehicles, one-to-one: the ids of these. Two tracks match if they are at the same
    place, in the ego frame or the image, in half of their common frames."""
    there = {(track.id, each.frame): each for track in known for each in track.sightings}
    by_frame: dict[int, list[int]] = {}
    for number, frame in there:
        by_frame.setdefault(frame, []).append(number)
    votes = []
    for track in proposals:
        together: dict[int, int] = {}
        same: dict[int, int] = {}
        for each in track.sightings:
            for number in by_frame.get(each.frame, ()):
                together[number] = together.get(number, 0) + 1
                same[number] = same.get(number, 0) + _is_same(each, there[number, each.frame])
        votes += [
            (count, track.id, number)
            for number, count in same.items()
            if count and count >= _SAME_SHARE * together[number]
        ]
    found: dict[int, int] = {}
    for _, mine, theirs in sorted(votes, key=lambda vote: (-vote[0], vote[1], vote[2])):
        if mine not in found and theirs not in found.values():
            found[mine] = theirs
    return found


def _track(number: int, life: Mapping[int, Seen], poses: Mapping[int, Pose], origin: Origin) -> LabelTrack | None:
    """None if it is not proposed."""
    seen = [index for index, each in life.items() if not each.carried]
    names = [each.label for each in life.values() if each.label in ROAD_USERS]
    if not seen:
        return None
    label = max(sorted(set(names)), key=names.count) if names else NAMELESS
    only_once = len(seen) < _FEWEST
    placed = (
        Sighting(index, None if only_once else _of_class(each.cuboid, label), each.bbox, keyframe=False)
        for index, each in life.items()
        if seen[0] <= index <= seen[-1]
    )
    sightings = tuple(each for each in placed if each.cuboid is not None or each.bbox is not None)
    drives = _drives([each for each in sightings if each.frame in seen], poses)
    if not sightings or not (names or drives):
        return None
    in_path = [index for index, each in life.items() if each.in_path]
    is_one = _spread([each for each in sightings if each.frame in seen]) <= _ONE_BODY
    whole, heading = faced(_whole(sightings, label), in_path, poses if is_one else {})
    confidence = round(_confidence([life[index] for index in seen], drives=drives), 3)
    return LabelTrack(number, label, whole, "proposed", origin, confidence=confidence, heading=heading)


def _drives(seen: Sequence[Sighting], poses: Mapping[int, Pose]) -> bool:
    """Whether it certainly moved over ground and is as large as a vehicle. Clusters of objects longer than their
    visible part seem to move along with us, but are larger, or fragments."""
    sizes = np.array([each.cuboid.size for each in seen if each.cuboid is not None]).reshape(-1, 3)
    if len(sizes) <= _FEWEST_STEPS:
        return False
    length, width, height = np.median(sizes, axis=0)
    moved = travelled(seen, poses)
    is_large = max(length, width) >= _NARROWEST_M and height >= _LOWEST_M
    is_body = is_large and _spread(seen) <= _RIGID
    return bool(is_body and moved.proven and abs(moved.along_m) >= max(length, width))


def _spread(seen: Sequence[Sighting]) -> float:
    """Variation of the visible height or longest side, as a share of its median; 0 for a single cuboid."""
    sizes = np.array([each.cuboid.size for each in seen if each.cuboid is not None]).reshape(-1, 3)
    if not len(sizes):
        return 0.0
    sides = np.column_stack([sizes[:, :2].max(axis=1), sizes[:, 2]])
    return float((sides.std(axis=0) / np.median(sides, axis=0)).max())


def _confidence(seen: Sequence[Seen], *, drives: bool) -> float:
    """Probability that it is a road user, 0–1: from the mean score of its sightings, where one without a class counts
    as 0, with one additional miss (Laplace's rule of succession); and from its motion."""
    scores = [(each.score or 0.0) if each.label in ROAD_USERS else 0.0 for each in seen]
    by_name = sum(scores) / (len(scores) + 1)
    by_motion = _NAMELESS_WEIGHT if drives else 0.0
    return 1.0 - (1.0 - by_name) * (1.0 - by_motion)


def _of_class(cuboid: Cuboid | None, label: str) -> Cuboid | None:
    """None if the cuboid is too large for a vehicle of this class."""
    if cuboid is None:
        return None
    (length, width, height), (longest, widest, tallest) = cuboid.size, largest_size_m(label)
    fits = length <= longest and width <= _OVER * widest and height <= _OVER * tallest
    return cuboid if fits else None


def _whole(sightings: tuple[Sighting, ...], label: str) -> tuple[Sighting, ...]:
    """The same track with cuboids of one size, between the usual and the largest of its class.

    The pipeline measures the visible part of a vehicle, often only its rear. The visible side stays in place.
    """
    seen = np.array([each.cuboid.size for each in sightings if each.cuboid is not None]).reshape(-1, 3)
    if not len(seen):
        return sightings
    size = np.clip(np.quantile(seen, _LARGE, axis=0), usual_size_m(label), largest_size_m(label))
    length, width, height = size.round(2).tolist()
    return tuple(
        replace(each, cuboid=resized(each.cuboid, (length, width, height))) if each.cuboid is not None else each
        for each in sightings
    )


def _lead(lead: int | None, kept: set[int], seen: Sequence[Seen], moment: Moment | None) -> Lead:
    """The proposed lead. kept: the proposed tracks. seen: objects in that frame."""
    if lead is not None:
        return lead if lead in kept else "unknown"
    is_free = not any(each.in_path and not each.carried and each.label in VEHICLES for each in seen)
    return "none" if is_free and moment is not None and moment.reach_m >= FARTHEST_LEAD_M else "unknown"


def _ranges(leads: Mapping[int, Lead], origin: Origin) -> list[LeadRange]:
    ranges: list[LeadRange] = []
    for index in sorted(leads):
        who = leads[index]
        if ranges and ranges[-1].lead == who and ranges[-1].last == index - 1:
            ranges[-1] = replace(ranges[-1], last=index)
        else:
            ranges.append(LeadRange(index, index, who, "proposed", origin))
    return ranges


def _is_same(a: Sighting, b: Sighting) -> bool:
    if a.cuboid is not None and b.cuboid is not None:
        return _apart_m(a.cuboid, b.cuboid) <= _SAME_M
    if a.bbox is not None and b.bbox is not None:
        return bool(iou_matrix(np.array([a.bbox]), np.array([b.bbox]))[0, 0] >= _SAME_IOU)
    return False


def _apart_m(a: Cuboid, b: Cuboid) -> float:
    """Distance of the centres, minus half the difference of their sizes: one may be only the visible part of a car."""
    slack_m = max(abs(a.size[0] - b.size[0]), abs(a.size[1] - b.size[1])) / 2
    return max(float(np.hypot(a.center[0] - b.center[0], a.center[1] - b.center[1])) - slack_m, 0.0)
