"""Converts labels to and from database values: items as JSON, sightings as rows, changes as compressed JSON."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from pydantic import ConfigDict, TypeAdapter

from pipeline.common.geometry import Cuboid
from pipeline.labels.model import EventLabel, FrameTag, LabelTrack, LeadRange, PathLabel, Sighting

LONGEST_NAME = 80
"""Maximum length of a person's name and of a version's name."""
LONGEST_ITEM = 120
"""Maximum length of a parameter's name and of a recording's key."""
ItemKind = Literal["track", "lead", "path", "event", "tag"]
KINDS: tuple[ItemKind, ...] = get_args(ItemKind)
Value = LabelTrack | LeadRange | PathLabel | EventLabel | FrameTag
Frames = Mapping[int, Sighting | None]
"""Sightings of one track by frame; None if there is none (any more)."""

_ADAPTERS: dict[ItemKind, TypeAdapter[Any]] = {
    "track": TypeAdapter(LabelTrack),
    "lead": TypeAdapter(LeadRange),
    "path": TypeAdapter(PathLabel),
    "event": TypeAdapter(EventLabel),
    "tag": TypeAdapter(FrameTag),
}
_SIGHTINGS = TypeAdapter(tuple[Sighting, ...])
_QUICK = 1
"""Compression level of large changes: already reduces them to a third; higher levels gain little."""


@dataclass(frozen=True)
class Item:
    """The current state of one label."""

    kind: ItemKind
    """Numbers are unique within a kind only."""
    id: int
    """Unique among items of its kind."""
    revision: int
    """Number of the act that changed it last."""
    value: Value
    """Its content; a track comes without its sightings, which have separate rows."""


@dataclass(frozen=True)
class Content:
    """Content of an item before or after an act."""

    value: Value | None
    """None if it did not exist."""
    frames: Frames
    """For a track: sightings in the frames that the act changed."""


@dataclass(frozen=True)
class HistoryEntry:
    """One act in an item's life."""

    __pydantic_config__ = ConfigDict(use_attribute_docstrings=True)  # the API returns it unchanged

    act: int
    """Number of the act in the log."""
    what: str
    """The act in words."""
    note: str
    """What there was to say about it; empty for nothing."""
    person: str
    """Who did it."""
    t_unix_ms: int
    """When, in Unix milliseconds."""
    before: dict[str, Any] | None
    """The item as JSON, None where it was not there; of a track, with the sightings that the act changed."""
    after: dict[str, Any] | None
    """The same, as the act left it."""
    undone: bool
    """Whether it has been taken back since."""


def value_to_json(kind: ItemKind, value: Value) -> dict[str, Any]:
    """Plain values in the format of the native file; a track without its sightings."""
    if isinstance(value, LabelTrack):
        value = replace(value, sightings=())
    found: dict[str, Any] = _ADAPTERS[kind].dump_python(value, mode="json")
    found.pop("sightings", None)
    return found


def value_from_json(kind: ItemKind, body: Mapping[str, Any]) -> Value:
    """The value of an item as stored; a track comes without its sightings. ValidationError when malformed."""
    return _ADAPTERS[kind].validate_python({**body, "sightings": ()} if kind == "track" else body)


def sighting_to_json(sighting: Sighting) -> dict[str, Any]:
    """In the format of the native file."""
    cuboid = sighting.cuboid
    return {
        "frame": sighting.frame,
        "cuboid": list(cuboid) if cuboid is not None else None,
        "bbox": list(sighting.bbox) if sighting.bbox is not None else None,
        "keyframe": sighting.keyframe,
        "box_set": sighting.box_set,
        "truncation": sighting.truncation,
        "occlusion": sighting.occlusion,
    }


def row_of(drive_id: int, track: int, sighting: Sighting) -> tuple[Any, ...]:
    """Values in the order of the table's columns."""
    cuboid, bbox = sighting.cuboid, sighting.bbox
    place = (*cuboid.center, *cuboid.size, cuboid.yaw_rad) if cuboid is not None else (None,) * 7
    sides = bbox if bbox is not None else (None,) * 4
    more = (sighting.box_set, sighting.truncation, sighting.occlusion)
    return (drive_id, sighting.frame, track, sighting.keyframe, *place, *sides, *more)


def sighting_of(row: Any) -> Sighting:
    """row: in the format of ``row_of``."""
    _, frame, _, keyframe, x, y, z, length, width, height, yaw, x1, y1, x2, y2, box_set, truncation, occlusion = row
    cuboid = Cuboid((x, y, z), (length, width, height), yaw) if x is not None else None
    bbox = (x1, y1, x2, y2) if x1 is not None else None
    return Sighting(frame, cuboid, bbox, bool(keyframe), bool(box_set), truncation, occlusion)


def pack_content(kind: ItemKind, content: Content) -> bytes | None:
    """None for an item that does not exist and has no frames."""
    if content.value is None and not any(content.frames.values()):
        return None
    return pack(
        {
            "value": value_to_json(kind, content.value) if content.value is not None else None,
            "frames": sorted(content.frames),
            "sightings": [sighting_to_json(each) for each in content.frames.values() if each is not None],
        }
    )


def unpack_content(kind: ItemKind, data: bytes | None, frames: Iterable[int] = ()) -> Content:
    """frames: further frames of the act, in which there was no sighting."""
    if data is None:
        return Content(None, dict.fromkeys(frames))
    body = unpack(data)
    found: dict[int, Sighting | None] = dict.fromkeys([*body["frames"], *frames])
    for each in _SIGHTINGS.validate_python(body["sightings"]):
        found[each.frame] = each
    value = value_from_json(kind, body["value"]) if body["value"] is not None else None
    return Content(value, found)


def unpack_pair(kind: ItemKind, here: bytes | None, there: bytes | None) -> tuple[Content, Content]:
    """Both sides of a change, each with every frame that it affects."""
    found = unpack_content(kind, here)
    other = unpack_content(kind, there, found.frames)
    return (Content(None, dict.fromkeys(other.frames)) if here is None else found), other


def pack(body: Any) -> bytes:
    """A JSON value, compressed for the database."""
    return zlib.compress(json.dumps(body, separators=(",", ":"), ensure_ascii=False).encode(), _QUICK)


def unpack(data: bytes) -> Any:
    """Inverse of ``pack``."""
    return json.loads(zlib.decompress(data))
