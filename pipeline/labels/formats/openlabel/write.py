"""ASAM OpenLABEL 1.0: tracks are objects with a cuboid and a bbox a frame, the lead is a relation to the ego vehicle.

Cuboids are ``x y z qx qy qz qw sx sy sz`` in the coordinate system ``ego``, bboxes ``x y w h`` around their centre,
in pixels of the raw image. What a relation has no place for (states, who made it, that nobody leads) is an action of
the same number. Frame intervals include both ends. Nothing of a label set is lost.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pipeline.common.geometry import inverse
from pipeline.formats.file_reading import check_looks_ahead
from pipeline.labels.formats.base import LabeledDrive, write_file
from pipeline.labels.model import EventLabel, LabelSet, LabelTrack, LeadRange, Origin, PathLabel, Sighting
from pipeline.types import Point2

EGO_UID = "00000000-0000-0000-0000-000000000000"
_PATH_UID = "00000000-0000-0000-0001-{:012d}"
EGO, CAMERA = "ego", "camera"
LEADS, TAKES_PART = "isLeadVehicleOf", "participatesIn"
LEAD, NO_LEAD, LEAD_UNKNOWN = "lead", "no_lead", "lead_unknown"
EGO_TYPE, PATH_TYPE, TAG_TYPE = "ego_vehicle", "ego_path", "frame_tag"
OURS = "cipv"
"""Key in the metadata that identifies files of this program."""
JsonElement = dict[str, Any]


def write(labels: LabelSet, drive: LabeledDrive, out: Path) -> tuple[str, ...]:
    content = {
        "metadata": {
            "schema_version": "1.0.0",
            "name": labels.name,
            "tagged_file": drive.uri,
            OURS: {"version": 1},
        },
        "coordinate_systems": _coordinate_systems(drive),
        "objects": _objects(labels),
        "actions": {str(i): _lead_action(each) for i, each in enumerate(labels.leads)},
        "relations": _relations(labels),
        "events": {
            str(i): _element(each.kind, each.kind, each.frame, each.frame) | {"event_data": _marks(each.origin, each)}
            for i, each in enumerate(labels.events)
        },
        "contexts": {
            str(i): _element(each.tag, TAG_TYPE, each.first, each.last) | {"context_data": _marks(each.origin)}
            for i, each in enumerate(labels.tags)
        },
        "frames": _frames(labels, drive),
        "frame_intervals": [_interval(0, len(drive.shots) - 1)] if drive.shots else [],
    }
    text = json.dumps({"openlabel": content}, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    write_file(out, text.encode() + b"\n")
    return ()


def _coordinate_systems(drive: LabeledDrive) -> JsonElement:
    """``ego``, and the camera with its first calibration."""
    camera = next((shot.camera for shot in drive.shots if shot.camera is not None), None)
    systems: JsonElement = {EGO: {"type": "local_cs", "parent": "", "children": [CAMERA] if camera is not None else []}}
    if camera is not None:
        check_looks_ahead(camera, "the recording's calibration")
        pose = {"matrix4x4": inverse(camera.T_camera_ego).ravel().tolist()}
        systems[CAMERA] = {"type": "sensor_cs", "parent": EGO, "children": [], "pose_wrt_parent": pose}
    return systems


def _objects(labels: LabelSet) -> dict[str, JsonElement]:
    objects: dict[str, JsonElement] = {EGO_UID: {"name": "ego", "type": EGO_TYPE}}
    for track in labels.tracks:
        objects[str(track.id)] = {
            "name": f"{track.label} {track.id}",
            "type": track.label,
            "frame_intervals": _intervals(each.frame for each in track.sightings),
            "object_data": _marks(track.origin, track),
        }
    for place, path in enumerate(labels.paths):
        lines = [_line(name, line) for name, line in (("left", path.left), ("right", path.right)) if line is not None]
        objects[_PATH_UID.format(place)] = _element("ego path", PATH_TYPE, path.frame, path.frame) | {
            "object_data": _marks(path.origin, path) | {"poly3d": lines}
        }
    return objects


def _line(name: str, line: tuple[Point2, ...]) -> JsonElement:
    flat = [value for x, y in line for value in (x, y, 0.0)]
    return {"name": name, "val": flat, "closed": False, "coordinate_system": EGO}


def _lead_action(lead: LeadRange) -> JsonElement:
    kind = NO_LEAD if lead.lead == "none" else LEAD_UNKNOWN if lead.lead == "unknown" else LEAD
    return _element(kind, kind, lead.first, lead.last) | {"action_data": _marks(lead.origin, lead)}


def _relations(labels: LabelSet) -> dict[str, JsonElement]:
    """Lead relations have the same number as their action; events come after them."""
    relations: dict[str, JsonElement] = {}
    for place, lead in enumerate(labels.leads):
        if isinstance(lead.lead, int):
            relations[str(place)] = _element(LEADS, LEADS, lead.first, lead.last) | {
                "rdf_subjects": [{"type": "object", "uid": str(lead.lead)}],
                "rdf_objects": [{"type": "object", "uid": EGO_UID}],
            }
    for place, event in enumerate(labels.events):
        if event.tracks:
            relations[str(len(labels.leads) + place)] = _element(TAKES_PART, TAKES_PART, event.frame, event.frame) | {
                "rdf_subjects": [{"type": "object", "uid": str(number)} for number in event.tracks],
                "rdf_objects": [{"type": "event", "uid": str(place)}],
            }
    return relations


def _frames(labels: LabelSet, drive: LabeledDrive) -> dict[str, JsonElement]:
    """Each frame with its objects; frames refer to the elements whose intervals contain them."""
    frames: list[JsonElement] = [{"frame_properties": {"timestamp": str(shot.t_ns)}} for shot in drive.shots]
    for track in labels.tracks:
        for sighting in track.sightings:
            frames[sighting.frame].setdefault("objects", {})[str(track.id)] = {"object_data": _seen(sighting)}
    for place, path in enumerate(labels.paths):
        frames[path.frame].setdefault("objects", {})[_PATH_UID.format(place)] = {}
    for place, lead in enumerate(labels.leads):
        kinds = ("actions", "relations") if isinstance(lead.lead, int) else ("actions",)
        for frame in range(lead.first, lead.last + 1):
            for kind in kinds:
                frames[frame].setdefault(kind, {})[str(place)] = {}
    for place, event in enumerate(labels.events):
        frames[event.frame].setdefault("events", {})[str(place)] = {}
        if event.tracks:
            frames[event.frame].setdefault("relations", {})[str(len(labels.leads) + place)] = {}
    for place, tag in enumerate(labels.tags):
        for frame in range(tag.first, tag.last + 1):
            frames[frame].setdefault("contexts", {})[str(place)] = {}
    return {str(index): frame for index, frame in enumerate(frames)}


def _seen(sighting: Sighting) -> JsonElement:
    data: JsonElement = {"boolean": [{"name": "keyframe", "val": sighting.keyframe}]}
    if sighting.box_set:
        data["boolean"].append({"name": "box_set", "val": True})
    numbers = (("truncation", sighting.truncation), ("occlusion", sighting.occlusion))
    if said := [{"name": name, "val": val} for name, val in numbers if val is not None]:
        data["num"] = said
    if sighting.cuboid is not None:
        half_rad = sighting.cuboid.yaw_rad / 2
        turn = (0.0, 0.0, math.sin(half_rad), math.cos(half_rad))
        val = [*sighting.cuboid.center, *turn, *sighting.cuboid.size]
        data["cuboid"] = [{"name": "cuboid", "val": val, "coordinate_system": EGO}]
    if sighting.bbox is not None:
        x1, y1, x2, y2 = sighting.bbox
        val = [(x1 + x2) / 2, (y1 + y2) / 2, x2 - x1, y2 - y1]
        data["bbox"] = [{"name": "bbox", "val": val, "coordinate_system": CAMERA}]
    return data


def _marks(origin: Origin, marked: LabelTrack | LeadRange | PathLabel | EventLabel | None = None) -> JsonElement:
    """State, review and origin as text and number attributes of any element. marked: None if it has no state."""
    texts: dict[str, str | None] = {"maker": origin.maker, "by": origin.name, "how": origin.how or None}
    texts |= {"params": origin.params, "calibration": origin.calibration}
    if marked is not None:
        texts |= {"heading": (marked.heading or None) if isinstance(marked, LabelTrack) else None}
        texts |= {"state": marked.state, "comment": marked.comment or None, "reviewer": marked.reviewer or None}
    numbers: list[dict[str, str | float]] = [{"name": "made_unix_ms", "val": origin.t_unix_ms}]
    if isinstance(marked, LabelTrack) and marked.confidence is not None:
        numbers.append({"name": "confidence", "val": marked.confidence})
    return {
        "text": [{"name": name, "val": value} for name, value in texts.items() if value is not None],
        "num": numbers,
    }


def _element(name: str, kind: str, first: int, last: int) -> JsonElement:
    return {"name": name, "type": kind, "frame_intervals": [_interval(first, last)]}


def _interval(first: int, last: int) -> JsonElement:
    return {"frame_start": first, "frame_end": last}


def _intervals(frames: Iterable[int]) -> list[JsonElement]:
    """Ascending frames as contiguous intervals."""
    found: list[JsonElement] = []
    for frame in frames:
        if found and found[-1]["frame_end"] == frame - 1:
            found[-1]["frame_end"] = frame
        else:
            found.append(_interval(frame, frame))
    return found
