"""Labels in the form that the API returns. A cuboid looks like an object in results; everything else as in the native
file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from app.labels.store.values import HistoryEntry, Item, ItemKind, value_to_json
from pipeline.labels.model import LabelTrack, Sighting

if TYPE_CHECKING:
    from app.labels.store.drive_labels import DriveInfo, DriveLabels, LabelSetChanges

_LISTS: dict[ItemKind, str] = {"track": "tracks", "lead": "leads", "path": "paths", "event": "events", "tag": "tags"}


def changes_json(info: DriveInfo, changes: LabelSetChanges) -> dict[str, Any]:
    """What changed, by kind; tracks are without their sightings."""
    lists: dict[str, list[dict[str, Any]]] = {name: [] for name in _LISTS.values()}
    for item in changes.items:
        body = item_json(item, changes.authors)
        if item.kind == "track":
            first, last, count, keyframes = changes.extents.get(item.id, (None, None, 0, []))
            body |= {"first": first, "last": last, "keyframes": keyframes, "sightings": count}
        lists[_LISTS[item.kind]].append(body)
    return {
        "revision": changes.revision,
        "drive": {"id": info.key, "uri": info.uri, "count": len(info.t_ns)},
        **lists,
        "removed": [{"kind": kind, "id": number} for kind, number in changes.removed],
    }


def window_json(labels: DriveLabels, first: int, last: int) -> dict[str, Any]:
    """The tracks in every frame from first to last that contains one."""
    revision, found = labels.window(first, last)
    return {
        "revision": revision,
        "sightings": {
            str(frame): [{"track": track, **placed_json(sighting)} for track, sighting in tracks]
            for frame, tracks in found.items()
        },
    }


def track_json(item: Item, authors: Mapping[tuple[ItemKind, int], str]) -> dict[str, Any]:
    """A whole track."""
    assert isinstance(item.value, LabelTrack)
    sightings = [{"frame": each.frame, **placed_json(each)} for each in item.value.sightings]
    return {**item_json(item, authors), "sightings": sightings}


def item_json(item: Item, authors: Mapping[tuple[ItemKind, int], str]) -> dict[str, Any]:
    """An item in the API's format, with its revision and, except for tags, its author."""
    author = {"author": authors.get((item.kind, item.id), "")} if item.kind != "tag" else {}
    return {"id": item.id, **value_to_json(item.kind, item.value), "revision": item.revision, **author}


def placed_json(sighting: Sighting) -> dict[str, Any]:
    """One frame of a track: cuboid (ego frame, metres), image box (pixels), and their properties."""
    cuboid = sighting.cuboid
    return {
        "cuboid": cuboid._asdict() if cuboid is not None else None,
        "bbox": sighting.bbox,
        "keyframe": sighting.keyframe,
        "box_set": sighting.box_set,
        "truncation": sighting.truncation,
        "occlusion": sighting.occlusion,
    }


def history_json(entry: HistoryEntry) -> dict[str, Any]:
    """One act with the items before and after it."""
    return {**vars(entry), "before": _content_json(entry.before), "after": _content_json(entry.after)}


def _content_json(content: dict[str, Any] | None) -> dict[str, Any] | None:
    """The stored item, with the sightings that the act changed."""
    if content is None:
        return None
    sightings = []
    for each in content["sightings"]:
        cuboid = each["cuboid"]
        named = dict(zip(("center", "size", "yaw_rad"), cuboid, strict=True)) if cuboid is not None else None
        sightings.append({**each, "cuboid": named})
    return {**(content["value"] or {}), "sightings": sightings}
