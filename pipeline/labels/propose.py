"""What the pipeline saw in a drive, as labels that nobody has looked at yet.

Not everything it follows is worth a look: roadside returns are half of it. Proposed is what the camera has called a
road user in a frame, and what was the lead or stood in the path in one. A track ends where it was last seen, not
where it was last predicted to be; between two sightings a prediction stands in. A cluster larger than any of its class
is a vehicle and what stands beside it, or none at all: where it lies tells nothing, and its box alone is kept.

What the camera alone sees is proposed as a box in the picture, without a cuboid. One from how tall it looks, as
``pipeline.labels.cuboid_from_pixel`` makes where somebody points, was tried: on Astyx its middle was 14 m off (median
of 55 that have truth, at 68 m), two in three did not even touch the vehicle; and a distance that nobody measured must
not become the truth by which distances are scored.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.common.geometry import Cuboid, iou_matrix
from pipeline.fusion.vehicle_sizes import largest_size_m, usual_size_m
from pipeline.labels.interpolate import resized
from pipeline.labels.model import LabelTrack, Lead, LeadRange, Origin, Sighting
from pipeline.types import VEHICLES, Box

ROAD_USERS = VEHICLES | {"person", "bicycle"}
NAMELESS = "car"
"""What the LiDAR alone has seen is most often that."""
_SAME_M = 2.0
_SAME_IOU = 0.4
_SAME_SHARE = 0.5
_LARGE = 0.9
"""Of a track's sightings are smaller: single ones take in what stands beside."""
_FEWEST = 2
"""Seen once and never again is mostly noise."""
_OVER = 1.25
"""How far, as a factor, a cluster may be wider or taller than the largest of its class: an open door, a branch."""


@dataclass(frozen=True)
class Seen:
    """An object of one frame's result."""

    id: int
    label: str | None
    cuboid: Cuboid | None
    bbox: Box | None
    in_path: bool
    carried: bool


@dataclass(frozen=True)
class Proposals:
    """Tracks under the run's own numbers, and who leads."""

    tracks: tuple[LabelTrack, ...]
    leads: tuple[LeadRange, ...]


def propose(frames: Mapping[int, Sequence[Seen]], leads: Mapping[int, int | None], origin: Origin) -> Proposals:
    """frames: what was seen in each, by index. leads: the CIPV's number of each frame, None for none."""
    by_id: dict[int, dict[int, Seen]] = {}
    for index in sorted(frames):
        for seen in frames[index]:
            by_id.setdefault(seen.id, {})[index] = seen
    chosen = {lead for lead in leads.values() if lead is not None}
    tracks = tuple(
        track
        for number, life in sorted(by_id.items())
        if (track := _track(number, life, number in chosen, origin)) is not None
    )
    kept = {track.id for track in tracks}
    return Proposals(tracks, tuple(_ranges(leads, kept, origin)))


def known_as(proposals: Sequence[LabelTrack], known: Sequence[LabelTrack]) -> dict[int, int]:
    """Which proposals are vehicles that are labelled already, one to one: their numbers there. Two are the same when
    they are in the same place, ego frame or picture, in half of the frames that both are in."""
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


def _track(number: int, life: Mapping[int, Seen], leads: bool, origin: Origin) -> LabelTrack | None:
    """None for what is not proposed."""
    seen = [index for index, each in life.items() if not each.carried]
    names = [each.label for each in life.values() if each.label in ROAD_USERS]
    is_worth_it = leads or ((names or any(each.in_path for each in life.values())) and len(seen) >= _FEWEST)
    if not seen or not is_worth_it:
        return None
    label = max(sorted(set(names)), key=names.count) if names else NAMELESS
    placed = (
        Sighting(index, _of_class(each.cuboid, label), each.bbox, keyframe=False)
        for index, each in life.items()
        if seen[0] <= index <= seen[-1]
    )
    sightings = tuple(each for each in placed if each.cuboid is not None or each.bbox is not None)
    return LabelTrack(number, label, _whole(sightings, label), "proposed", origin) if sightings else None


def _of_class(cuboid: Cuboid | None, label: str) -> Cuboid | None:
    """None for one that no vehicle of a class fills."""
    if cuboid is None:
        return None
    (length, width, height), (longest, widest, tallest) = cuboid.size, largest_size_m(label)
    fits = length <= longest and width <= _OVER * widest and height <= _OVER * tallest
    return cuboid if fits else None


def _whole(sightings: tuple[Sighting, ...], label: str) -> tuple[Sighting, ...]:
    """The same track with cuboids of one size, between the usual and the largest one of its class.

    The pipeline measures what was seen of a vehicle, often its rear alone. The side that was seen stays in place.
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


def _ranges(leads: Mapping[int, int | None], kept: set[int], origin: Origin) -> list[LeadRange]:
    ranges: list[LeadRange] = []
    for index in sorted(leads):
        lead = leads[index]
        if lead is not None and lead not in kept:
            continue
        who: Lead = lead if lead is not None else "none"
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
    """From middle to middle, less half of what their sizes differ by: one may be only what is seen of a car."""
    slack_m = max(abs(a.size[0] - b.size[0]), abs(a.size[1] - b.size[1])) / 2
    return max(float(np.hypot(a.center[0] - b.center[0], a.center[1] - b.center[1])) - slack_m, 0.0)
