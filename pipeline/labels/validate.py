"""Validates label sets from files, databases and people; an error is one sentence."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from pipeline.common.errors import BadInput
from pipeline.labels.model import EventLabel, FrameTag, LabelSet, LabelTrack, LeadRange, PathLabel, Sighting

FARTHEST_M = 1e6
_LARGEST_PX = 1e6
_LARGEST_INT = 2**63
LARGEST_YAW_RAD = 1e3
LARGEST_SIDE_M = 200.0


def check(labels: LabelSet, what: str) -> LabelSet:
    """Returns the set. BadInput, beginning with ``what``, for the first invalid value: a number that is not finite or
    out of bounds, a frame outside the recording, two tracks with the same id, leads that overlap."""
    try:
        _check_frames(labels)
        _check_tracks(labels)
        _check_leads(labels)
        for path in labels.paths:
            _check_path(path)
        for tag in labels.tags:
            _require(0 <= tag.first <= tag.last < len(labels.frames), f"a tag from frame {tag.first} to {tag.last}")
        at_frames: tuple[PathLabel | EventLabel, ...] = (*labels.paths, *labels.events)
        for each in at_frames:
            _require(0 <= each.frame < len(labels.frames), f"frame {each.frame} of {len(labels.frames)}")
        for event in labels.events:
            _require(all(_fits(number) for number in event.tracks), "an event with an invalid track id")
        made: tuple[LabelTrack | LeadRange | PathLabel | EventLabel | FrameTag, ...]
        made = (*labels.tracks, *labels.leads, *at_frames, *labels.tags)
        _require(all(_fits(label.origin.t_unix_ms) for label in made), "an invalid time")
    except ValueError as error:
        raise BadInput(f"{what}: {error}") from None
    return labels


def check_sighting(sighting: Sighting, what: str) -> Sighting:
    """Returns the sighting. BadInput, beginning with ``what``, if it is invalid."""
    wrong = _wrong_with(sighting)
    if wrong:
        raise BadInput(f"{what}: {wrong}")
    return sighting


def _check_frames(labels: LabelSet) -> None:
    _require(len(labels.frames) == len(labels.t_ns), f"{len(labels.frames)} frames but {len(labels.t_ns)} times")
    _require(all(_fits(t_ns) for t_ns in labels.t_ns), "an invalid time")


def _check_tracks(labels: LabelSet) -> None:
    ids = [track.id for track in labels.tracks]
    _require(all(0 <= number < _LARGEST_INT for number in ids), "a track id must not be negative")
    _require(len(set(ids)) == len(ids), "two tracks have the same id")
    for track in labels.tracks:
        _check_track(track, len(labels.frames))


def _check_track(track: LabelTrack, count: int) -> None:
    frames = [each.frame for each in track.sightings]
    _require(all(0 <= frame < count for frame in frames), f"track {track.id} is in a frame that does not exist")
    _require(frames == sorted(set(frames)), f"track {track.id}: sightings are not in frame order")
    for said in track.attributes:
        _require(
            0 <= said.first <= said.last < count, f"track {track.id}: {said.name!r} refers to frames that do not exist"
        )
    sure = track.confidence
    _require(sure is None or 0.0 <= sure <= 1.0, f"track {track.id}: a confidence must be between 0 and 1")
    for sighting in track.sightings:
        wrong = _wrong_with(sighting)
        if wrong:
            raise ValueError(f"track {track.id}, frame {sighting.frame}: {wrong}")


def _wrong_with(sighting: Sighting) -> str:
    """The problem; empty if there is none."""
    if sighting.cuboid is not None:
        center, size, yaw_rad = sighting.cuboid
        if not _below(center, FARTHEST_M):
            return "the cuboid has no valid position"
        if not all(0.0 < side <= LARGEST_SIDE_M for side in size):
            return "the cuboid has no valid size"
        if not _below((yaw_rad,), LARGEST_YAW_RAD):
            return "the cuboid has no valid yaw"
    if sighting.bbox is not None:
        x1, y1, x2, y2 = sighting.bbox
        if not (_below(sighting.bbox, _LARGEST_PX) and x1 < x2 and y1 < y2):
            return "invalid box"
    if sighting.truncation is not None and not 0.0 <= sighting.truncation <= 1.0:
        return "a truncation must be between 0 and 1"
    if sighting.occlusion not in (None, 0, 1, 2):
        return "an occlusion must be 0, 1 or 2"
    return ""


def _check_leads(labels: LabelSet) -> None:
    for each in labels.leads:
        _require(0 <= each.first <= each.last < len(labels.frames), f"a lead from frame {each.first} to {each.last}")
        _require(isinstance(each.lead, str) or _fits(each.lead), "the lead is not a track")
    _check_apart([each for each in labels.leads if each.state != "rejected"])


def _check_apart(leads: list[LeadRange]) -> None:
    ordered = sorted(leads, key=lambda each: each.first)
    for before, after in pairwise(ordered):
        _require(before.last < after.first, f"two leads at frame {after.first}")


def _check_path(path: PathLabel) -> None:
    for line in (path.left, path.right):
        _require(_below((v for point in line or () for v in point), FARTHEST_M), "a path line without valid points")


def _fits(number: int) -> bool:
    return -_LARGEST_INT <= number < _LARGEST_INT


def _below(values: Iterable[float], limit: float) -> bool:
    """False for non-finite values."""
    return all(-limit < value < limit for value in values)


def _require(holds: bool, otherwise: str) -> None:
    if not holds:
        raise ValueError(otherwise)
