"""Reads labels from ASAM OpenLABEL 1.0 files, our own and others'."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid, transform
from pipeline.formats.file_reading import rigid_transform
from pipeline.labels.formats.base import Imported, LabeledDrive
from pipeline.labels.formats.openlabel import write as ol
from pipeline.labels.formats.openlabel.file_types import Agent, Data, Element, File, FileContent, FileShape
from pipeline.labels.formats.reading import fit, parse_as, read_bytes
from pipeline.labels.model import (
    EventLabel,
    FrameTag,
    Heading,
    LabelTrack,
    Lead,
    LeadRange,
    Maker,
    Origin,
    PathLabel,
    Sighting,
    State,
)
from pipeline.types import F64, Point2

_STATE: TypeAdapter[State] = TypeAdapter(State)
_HEADING: TypeAdapter[Heading] = TypeAdapter(Heading)
_MAKER: TypeAdapter[Maker] = TypeAdapter(Maker)
_LARGEST_ID = 2**63
_DEEPEST = 32


_FILE = TypeAdapter(File)


def read(path: Path, drive: LabeledDrive, origin: Origin) -> Imported:
    """Frames are matched by number. BadInput if a file written by this program belongs to another recording."""
    return _Reading(parse_as(_FILE, read_bytes(path), str(path)).openlabel, drive, origin, str(path)).imported()


class _Reading:
    """Conversion of one file to labels."""

    def __init__(self, content: FileContent, drive: LabeledDrive, origin: Origin, what: str) -> None:
        self.content, self.drive, self.origin, self.what = content, drive, origin, what
        self.is_ours = ol.OURS in content.metadata
        if str(content.metadata.get("schema_version")) != "1.0.0":
            raise BadInput(f"{what}: not OpenLABEL 1.0.0")
        self.numbers = _numbers([uid for uid, each in content.objects.items() if _is_track(uid, each)])

    def imported(self) -> Imported:
        self._check_frames()
        name = self.content.metadata.get("name")
        labels = replace(
            self.drive.empty(),
            tracks=tuple(self._tracks()),
            leads=tuple(self._leads()),
            paths=tuple(self._paths()),
            events=tuple(self._events()),
            tags=tuple(self._tags()),
            name=name if self.is_ours and isinstance(name, str) else "working",
        )
        return Imported(labels, tuple(self._notes()))

    def _check_frames(self) -> None:
        for key, frame in self.content.frames.items():
            index = self._frame(key)
            told = frame.frame_properties.timestamp
            if self.is_ours and told != str(self.drive.shots[index].t_ns):
                raise BadInput(f"{self.what}: frame {index} has another time than in {self.drive.uri}")

    def _frame(self, key: str | int) -> int:
        text = str(key)
        if text.isascii() and text.isdecimal() and len(text) < 10 and int(text) < len(self.drive.shots):
            return int(text)
        raise BadInput(f"{self.what}: frame {text[:20]} of {len(self.drive.shots)}")

    def _tracks(self) -> Iterable[LabelTrack]:
        sightings: dict[str, list[Sighting]] = {uid: [] for uid in self.numbers}
        for key, frame in self.content.frames.items():
            for uid, seen in frame.objects.items():
                if uid in sightings:
                    sightings[uid].append(self._sighting(self._frame(key), seen.object_data))
                elif uid not in self.content.objects:
                    raise BadInput(f"{self.what}: frame {key} refers to an object {uid[:40]!r} that does not exist")
        for uid, number in self.numbers.items():
            each = self.content.objects[uid]
            state, origin = self._made(each.object_data)
            label = each.type if self.is_ours else self.drive.class_of(each.type, "openlabel")
            seen_in_order = tuple(sorted(sightings[uid], key=lambda s: s.frame))
            data = each.object_data
            yield LabelTrack(number, label, seen_in_order, state, origin, *_reviewed(data), *self._sureness(data))

    def _sighting(self, frame: int, data: Data) -> Sighting:
        cuboid = self._cuboid(data.cuboid[0]) if data.cuboid else None
        bbox = None
        if data.bbox:
            x, y, width, height = _of_length(data.bbox[0].val, (4,), f"{self.what}: a bbox")
            bbox = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
        keyframe, box_set = data.said("keyframe"), data.said("box_set")
        return Sighting(
            frame,
            cuboid,
            bbox,
            keyframe if isinstance(keyframe, bool) else True,
            box_set is True or (not self.is_ours and bbox is not None),
            *_hidden(data),
        )

    def _cuboid(self, shape: FileShape) -> Cuboid:
        """Nine numbers with Euler angles, or ten with a quaternion; only the rotation about z is kept."""
        val = _of_length(shape.val, (9, 10), f"{self.what}: a cuboid")
        if len(val) == 10:
            qx, qy, qz, qw = val[3:7]
            yaw_rad = math.atan2(2.0 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
        else:
            yaw_rad = val[5]
        T_root = self._pose(shape.coordinate_system)
        ahead = T_root[:3, :3] @ np.array([math.cos(yaw_rad), math.sin(yaw_rad), 0.0])
        x, y, z = (float(value) for value in transform(T_root, np.array([val[:3]]))[0])
        is_plain = np.array_equal(T_root, np.eye(4))
        yaw_rad = yaw_rad if is_plain else float(np.arctan2(ahead[1], ahead[0]))
        length, width, height = val[-3:]
        return Cuboid((x, y, z), (length, width, height), yaw_rad)

    def _pose(self, name: str) -> F64:
        """(4, 4) from a coordinate system to the root system."""
        T = np.eye(4)
        systems = self.content.coordinate_systems
        for _ in range(_DEEPEST):
            system = systems.get(name)
            if system is None or system.pose_wrt_parent is None:
                return T
            if system.pose_wrt_parent.matrix4x4 is None:
                raise BadInput(f"{self.what}: the pose of {name[:40]!r} is not a matrix4x4, the only supported form")
            val = _of_length(system.pose_wrt_parent.matrix4x4, (16,), f"{self.what}: a matrix4x4")
            T = rigid_transform(np.reshape(val, (4, 4)), f"{self.what}: the pose of {name[:40]!r}") @ T
            name = system.parent
        raise BadInput(f"{self.what}: the coordinate systems form a cycle")

    def _leads(self) -> Iterable[LeadRange]:
        """From actions in files of this program, else from relations alone."""
        if self.is_ours:
            for uid, action in self.content.actions.items():
                first, last = self._span(action)
                state, origin = self._made(action.action_data)
                yield LeadRange(first, last, self._who(uid, action.type), state, origin, *_reviewed(action.action_data))
            return
        for relation in self.content.relations.values():
            if relation.type == ol.LEADS:
                who = self._track_of(relation.rdf_subjects)
                for interval in relation.frame_intervals:
                    first, last = self._frame(interval.frame_start), self._frame(interval.frame_end)
                    yield LeadRange(first, last, who, "accepted", self.origin)

    def _who(self, uid: str, kind: str) -> Lead:
        if kind in (ol.NO_LEAD, ol.LEAD_UNKNOWN):
            return "none" if kind == ol.NO_LEAD else "unknown"
        relation = self.content.relations.get(uid)
        if kind != ol.LEAD or relation is None or relation.type != ol.LEADS:
            raise BadInput(f"{self.what}: the lead {uid[:20]!r} is not a track")
        return self._track_of(relation.rdf_subjects)

    def _track_of(self, subjects: list[Agent]) -> int:
        if len(subjects) != 1:
            raise BadInput(f"{self.what}: a lead of {len(subjects)} vehicles")
        return self._number(subjects[0].uid)

    def _number(self, uid: str) -> int:
        """A lead may refer to a track without an object in the file."""
        number = self.numbers.get(uid)
        if number is None and self.is_ours:
            number = _as_id(uid)
        if number is None:
            raise BadInput(f"{self.what}: no object {uid[:40]!r}")
        return number

    def _paths(self) -> Iterable[PathLabel]:
        for each in self.content.objects.values():
            if each.type == ol.PATH_TYPE:
                lines = {shape.name: self._line(shape.val) for shape in each.object_data.poly3d}
                state, origin = self._made(each.object_data)
                frame = self._span(each)[0]
                reviewed = _reviewed(each.object_data)
                yield PathLabel(frame, lines.get("left"), lines.get("right"), state, origin, *reviewed)

    def _line(self, val: list[float]) -> tuple[Point2, ...]:
        if len(val) % 3:
            raise BadInput(f"{self.what}: a poly3d of {len(val)} numbers")
        return tuple(zip(val[0::3], val[1::3], strict=True))

    def _events(self) -> Iterable[EventLabel]:
        tracks = {
            agent.uid: tuple(self._number(subject.uid) for subject in relation.rdf_subjects)
            for relation in self.content.relations.values()
            if relation.type == ol.TAKES_PART
            for agent in relation.rdf_objects
        }
        for uid, each in self.content.events.items():
            state, origin = self._made(each.event_data)
            frame, reviewed = self._span(each)[0], _reviewed(each.event_data)
            yield EventLabel(frame, each.type, tracks.get(uid, ()), state, origin, *reviewed)

    def _tags(self) -> Iterable[FrameTag]:
        for each in self.content.contexts.values():
            if each.type == ol.TAG_TYPE:
                yield FrameTag(*self._span(each), each.name, self._made(each.context_data)[1])

    def _span(self, each: Element) -> tuple[int, int]:
        if len(each.frame_intervals) != 1:
            raise BadInput(f"{self.what}: {each.name[:40]!r} has {len(each.frame_intervals)} frame intervals, not one")
        (interval,) = each.frame_intervals
        return self._frame(interval.frame_start), self._frame(interval.frame_end)

    def _made(self, data: Data) -> tuple[State, Origin]:
        """State and origin, if the file contains them."""
        if data.said("maker") is None:
            return "accepted", self.origin
        state = fit(_STATE, data.said("state") or "accepted", f"{self.what}, state")
        maker = fit(_MAKER, data.said("maker"), f"{self.what}, maker")
        at = data.said("made_unix_ms")
        texts = [data.said(name) for name in ("params", "calibration")]
        params, calibration = (str(text) if text is not None else None for text in texts)
        by, how = (str(data.said(name) or "") for name in ("by", "how"))
        return state, Origin(maker, by, at if type(at) is int else 0, params, calibration, how)

    def _sureness(self, data: Data) -> tuple[float | None, Heading]:
        """Confidence of a track, and the source of its heading, if the file contains them."""
        confidence = data.said("confidence")
        sure = float(confidence) if isinstance(confidence, (int, float)) and not isinstance(confidence, bool) else None
        return sure, fit(_HEADING, data.said("heading") or "", f"{self.what}, heading")

    def _notes(self) -> Iterable[str]:
        if self.is_ours:
            return
        other = sum(each.type != ol.LEADS for each in self.content.relations.values()) + len(self.content.actions)
        if other:
            yield f"{other:,} relations and actions other than {ol.LEADS} are dropped: labels cannot hold them"
        if self.content.objects and not any(each.type == ol.LEADS for each in self.content.relations.values()):
            yield "the file names no lead in any frame"


def _is_track(uid: str, each: Element) -> bool:
    return uid != ol.EGO_UID and each.type not in (ol.PATH_TYPE, ol.EGO_TYPE)


def _hidden(data: Data) -> tuple[float | None, int | None]:
    """(truncation, occlusion); None if the file does not contain them."""
    cut, hidden = data.said("truncation"), data.said("occlusion")
    is_cut = isinstance(cut, (int, float)) and not isinstance(cut, bool)
    return (float(cut) if is_cut else None), (hidden if type(hidden) is int else None)


def _reviewed(data: Data) -> tuple[str, str]:
    """(comment, reviewer); empty if the file does not contain them."""
    return str(data.said("comment") or ""), str(data.said("reviewer") or "")


def _numbers(uids: list[str]) -> dict[str, int]:
    """Object → track: its key if that is a number, else a new number after all others."""
    numbers = {uid: number for uid in uids if (number := _as_id(uid)) is not None}
    after = max(numbers.values(), default=0) + 1
    rest = (uid for uid in uids if uid not in numbers)
    return {**numbers, **{uid: after + place for place, uid in enumerate(rest)}}


def _as_id(uid: str) -> int | None:
    is_number = uid.isascii() and uid.isdecimal() and len(uid) < 20
    return int(uid) if is_number and int(uid) < _LARGEST_ID else None


def _of_length(values: list[float], lengths: tuple[int, ...], what: str) -> list[float]:
    if len(values) not in lengths or not all(math.isfinite(value) and abs(value) < 1e9 for value in values):
        raise BadInput(f"{what} of {len(values)} numbers, or with values out of range")
    return values
