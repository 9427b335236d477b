"""The native format, ``cipv-labels`` version 5: JSON with every field of ``LabelSet`` under its own name, without loss.

Unknown fields are an error, and newer versions are rejected. In version 1, a tag belonged to one frame; up to version
2, tracks had neither confidence nor heading; up to version 3, nothing marked boxes set by hand, and there was no
truncation or occlusion; up to version 4, tracks had no attributes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter

from pipeline.common.errors import BadInput
from pipeline.labels.formats.base import Imported, LabeledDrive, write_file
from pipeline.labels.formats.reading import fit, parse_json, read_bytes
from pipeline.labels.model import Attribute, EventLabel, FrameTag, LabelSet, LabelTrack, LeadRange, Origin, PathLabel
from pipeline.labels.validate import check

KIND = "cipv-labels"
VERSION = 5
_LABELS = TypeAdapter(LabelSet)
_AtFrame = TypeVar("_AtFrame", PathLabel, EventLabel)
_Range = TypeVar("_Range", LeadRange, FrameTag, Attribute)


def to_json(labels: LabelSet) -> bytes:
    """The file's bytes; equal labels give equal bytes. BadInput if the labels are invalid."""
    return _bytes(check(labels, "these labels"))


def _bytes(labels: LabelSet) -> bytes:
    body = _LABELS.dump_json(labels)
    return b'{"format":"%s","version":%d,"labels":%s}\n' % (KIND.encode(), VERSION, body)


def from_json(data: bytes, what: str) -> LabelSet:
    """The labels from a file. BadInput, beginning with ``what``, if it is invalid."""
    outer: Any = parse_json(data, what)
    if not isinstance(outer, dict) or outer.get("format") != KIND:
        raise BadInput(f"{what}: not a {KIND} file")
    version = outer.get("version")
    if not isinstance(version, int) or isinstance(version, bool) or not 1 <= version <= VERSION:
        raise BadInput(f"{what}: {KIND} of version {str(version)[:20]}; this program reads up to {VERSION}")
    inner = outer.get("labels")
    unknown = sorted(inner.keys() - {field.name for field in fields(LabelSet)}) if isinstance(inner, dict) else []
    if unknown:
        raise BadInput(f"{what}: unknown field {unknown[0][:40]!r}")
    if version < 2 and isinstance(inner, dict) and isinstance(inner.get("tags"), list):
        inner = {**inner, "tags": [as_range(tag) if isinstance(tag, dict) else tag for tag in inner["tags"]]}
    return check(fit(_LABELS, inner, what), what)


def as_range(tag: Mapping[str, Any]) -> dict[str, Any]:
    """Converts a tag of one frame, as in version 1, to a tag of a range of frames."""
    body = dict(tag)
    frame = body.pop("frame", None)
    return body | {"first": frame, "last": frame}


def write(labels: LabelSet, drive: LabeledDrive, out: Path) -> tuple[str, ...]:
    write_file(out, _bytes(labels))
    return ()


def read(path: Path, drive: LabeledDrive, origin: Origin) -> Imported:
    return onto(from_json(read_bytes(path), str(path)), drive, str(path))


def onto(labels: LabelSet, drive: LabeledDrive, what: str) -> Imported:
    """Labels of this drive, or of a drive that contains this clip or is a clip of it, converted to this drive's frame
    numbers.

    Frames are matched by name and time. BadInput if the two have no frame in common.
    """
    if (labels.frames, labels.t_ns) == (drive.frames, drive.t_ns):
        return Imported(replace(labels, source=drive.uri))
    here = {key: index for index, key in enumerate(zip(drive.frames, drive.t_ns, strict=True))}
    to = {old: here[key] for old, key in enumerate(zip(labels.frames, labels.t_ns, strict=True)) if key in here}
    if not to:
        raise BadInput(f"{what}: these labels are of another recording ({labels.source}): no frame matches")
    moved = replace(
        labels,
        source=drive.uri,
        frames=drive.frames,
        t_ns=drive.t_ns,
        tracks=tuple(moved for track in labels.tracks if (moved := _moved_track(track, to)).sightings),
        leads=tuple(part for each in labels.leads for part in _moved_range(each, to)),
        paths=_moved(labels.paths, to),
        events=_moved(labels.events, to),
        tags=tuple(part for each in labels.tags for part in _moved_range(each, to)),
    )
    note = (
        f"{len(to)} of the labels' {len(labels.frames)} frames are in this recording; labels of the others are left out"
    )
    return Imported(check(moved, what), (note,))


def _moved_track(track: LabelTrack, to: dict[int, int]) -> LabelTrack:
    kept = (replace(each, frame=to[each.frame]) for each in track.sightings if each.frame in to)
    said = tuple(part for each in track.attributes for part in _moved_range(each, to))
    return replace(track, sightings=tuple(sorted(kept, key=lambda each: each.frame)), attributes=said)


def _moved_range(label: _Range, to: dict[int, int]) -> list[_Range]:
    """The range's frames in this drive, as ranges: they may not be contiguous there."""
    frames = sorted(to[frame] for frame in range(label.first, label.last + 1) if frame in to)
    runs: list[list[int]] = []
    for frame in frames:
        if runs and runs[-1][-1] == frame - 1:
            runs[-1].append(frame)
        else:
            runs.append([frame])
    return [replace(label, first=run[0], last=run[-1]) for run in runs]


def _moved(labels: tuple[_AtFrame, ...], to: dict[int, int]) -> tuple[_AtFrame, ...]:
    return tuple(replace(each, frame=to[each.frame]) for each in labels if each.frame in to)
