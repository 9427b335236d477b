"""The class list of a project: a YAML file with classes, sub-classes, their names in each export, and attributes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import parse_yaml, read_yaml
from pipeline.labels.model import LabelSet
from pipeline.vision.classes import canonical

FILE = Path(__file__).with_name("classes.yaml")
"""Default classes, for a project without its own."""
EXPORTS = ("kitti", "nuscenes", "coco", "openlabel")
OF_SIGHTINGS = ("occlusion", "truncation")
"""Attributes that are fields of a sighting."""
_LONGEST_NAME = 40
_MOST = 200


@dataclass(frozen=True)
class LabelClass:
    """Class of a vehicle or person."""

    name: str
    """Name shown to users."""
    of: str | None = None
    """Parent class; None for a top-level class."""
    size: tuple[float, float, float] | None = None
    """Usual length, width, height in metres."""
    exports: Mapping[str, str] = field(default_factory=dict)
    """Names in export formats, by one of ``EXPORTS``."""


@dataclass(frozen=True)
class ClassList:
    """Classes of a project, in the order in which they are shown."""

    classes: Mapping[str, LabelClass]
    """By name."""
    attributes: Mapping[str, tuple[str, ...]]
    """Values by name."""

    def named(self, word: str) -> str:
        """The class for a name: one of the list, else the name as used by detectors."""
        lowered = word.strip().lower().replace("_", " ")
        return lowered if lowered in self.classes else canonical(word)

    def read_as(self, word: str, export: str) -> str | None:
        """The class for a name in an import: the class of this name, else the first with this name in the format; None
        if there is none."""
        lowered = word.strip().lower().replace("_", " ")
        if lowered in self.classes:
            return lowered
        called = (name for name, known in self.classes.items() if known.exports.get(export, "").lower() == lowered)
        return next(called, None)

    def base(self, name: str) -> str:
        """The class as which it is scored."""
        known = self.classes.get(name)
        return known.of or name if known is not None else name

    def written(self, name: str, export: str) -> str:
        """Its name in an export format."""
        known = self.classes.get(name)
        return known.exports.get(export, known.of or name) if known is not None else name


NO_CLASSES = ClassList({}, {})
"""For files whose names are read as detectors name things."""


@cache
def default_classes() -> ClassList:
    """The built-in classes."""
    return read_classes(FILE)


def read_classes(path: Path) -> ClassList:
    """A class list from a file. Raises BadInput, in one sentence, if it is invalid."""
    try:
        return _parsed(read_yaml(path, str(path)))
    except ValueError as error:
        raise BadInput(f"{path}: {error}") from None


@lru_cache(64)
def parse_classes(text: str, what: str) -> ClassList:
    """A class list from YAML text. Raises BadInput, beginning with ``what``, if it is invalid."""
    try:
        return _parsed(parse_yaml(text, what))
    except ValueError as error:
        raise BadInput(f"{what}: {error}") from None


def as_bases(labels: LabelSet, classes: ClassList) -> LabelSet:
    """Each track with the class as which it is scored."""
    return replace(labels, tracks=tuple(replace(track, label=classes.base(track.label)) for track in labels.tracks))


def as_written(labels: LabelSet, classes: ClassList, name: str) -> tuple[LabelSet, tuple[str, ...]]:
    """The labels with class names of a format, and a sentence for each name that differs. name: of the format; if it
    accepts any class, nothing changes."""
    export = "kitti" if name == "kitti-tracking" else name
    if export not in EXPORTS or export == "openlabel":
        return labels, ()
    changed = Counter(
        (track.label, called)
        for track in labels.tracks
        if (called := classes.written(track.label, export)) != track.label
    )
    tracks = tuple(replace(track, label=classes.written(track.label, export)) for track in labels.tracks)
    notes = tuple(
        f"{count:,} {'track' if count == 1 else 'tracks'} of class {label!r} written as {called!r}"
        for (label, called), count in sorted(changed.items())
    )
    return replace(labels, tracks=tracks), notes


def _parsed(body: Any) -> ClassList:
    _require(isinstance(body, dict) and isinstance(body.get("classes"), dict) and body["classes"], "no classes")
    unknown = sorted(map(str, body.keys() - {"classes", "attributes"}))
    _require(not unknown, f"unknown entry {unknown[0][:_LONGEST_NAME]!r}" if unknown else "")
    _require(len(body["classes"]) <= _MOST, f"more than {_MOST} classes")
    classes = {each.name: each for each in (_class(name, said) for name, said in body["classes"].items())}
    for each in classes.values():
        parent = classes.get(each.of) if each.of is not None else None
        _require(each.of is None or parent is not None, f"{each.name} is of {each.of!r}, which is not a class")
        _require(parent is None or parent.of is None, f"{each.name} is of {each.of!r}, which is itself a sub-class")
    attributes = body.get("attributes") or {}
    _require(isinstance(attributes, dict), "attributes must be a mapping of names to lists of values")
    return ClassList(classes, {_name(name): _values(name, values) for name, values in attributes.items()})


def _class(name: Any, said: Any) -> LabelClass:
    said = {} if said is None else said
    named = _name(name)
    _require(isinstance(said, dict), f"{named}: must be a mapping")
    unknown = sorted(map(str, said.keys() - {"of", "size", "exports"}))
    _require(not unknown, f"{named}: unknown entry {unknown[0][:_LONGEST_NAME]!r}" if unknown else "")
    size, exports = said.get("size"), said.get("exports") or {}
    _require(isinstance(exports, dict), f"{named}: exports must be a mapping of formats to names")
    for export, called in exports.items():
        _require(export in EXPORTS, f"{named}: unknown export {str(export)[:_LONGEST_NAME]!r}")
        _require(isinstance(called, str) and bool(called.strip()), f"{named}: {export} must be a name")
    return LabelClass(
        named,
        _name(said["of"]) if said.get("of") is not None else None,
        _size(named, size) if size is not None else None,
        exports,
    )


def _size(name: str, size: Any) -> tuple[float, float, float]:
    is_one = isinstance(size, list) and len(size) == 3 and all(type(side) in (int, float) for side in size)
    _require(is_one and all(math.isfinite(side) and 0.05 < side <= 100 for side in size), f"{name}: invalid size")
    return float(size[0]), float(size[1]), float(size[2])


def _values(name: Any, values: Any) -> tuple[str, ...]:
    is_list = isinstance(values, list) and 0 < len(values) <= _MOST
    _require(
        is_list and all(isinstance(each, str) for each in values), f"{name}: values must be a list of quoted strings"
    )
    return tuple(_name(value) for value in values)


def _name(name: Any) -> str:
    is_one = isinstance(name, str) and name.strip() == name and 0 < len(name) <= _LONGEST_NAME and name.isprintable()
    what = f"a name has 1 to {_LONGEST_NAME} printable characters and no space around it"
    _require(is_one, f"{str(name)[:_LONGEST_NAME]!r} is not a valid name: {what}")
    return str(name)


def _require(holds: bool, otherwise: str) -> None:
    if not holds:
        raise ValueError(otherwise)
