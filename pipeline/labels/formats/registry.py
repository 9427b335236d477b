"""Every format by name, and the two things that are done with one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from pipeline.errors import BadInput
from pipeline.labels.check import check
from pipeline.labels.formats import kitti, native
from pipeline.labels.formats.base import Drive, Format, Imported, check_extrinsic
from pipeline.labels.formats.parts import EVERYTHING, Part, reduce
from pipeline.labels.model import LabelSet, Origin

FormatName = Literal["native", "kitti", "kitti-tracking", "nuscenes", "coco", "openlabel", "csv", "mcap"]

_SHAPES: frozenset[Part] = frozenset(("cuboids", "boxes"))

FORMATS: dict[str, Format] = {
    each.name: each
    for each in (
        Format("native", "our own JSON, which holds everything", EVERYTHING, native.write, native.read),
        Format("kitti", "KITTI object labels", _SHAPES, kitti.write_objects, kitti.read_objects, True),
        Format(
            "kitti-tracking",
            "KITTI tracking labels",
            _SHAPES | {"identities"},
            kitti.write_tracking,
            kitti.read_tracking,
            True,
        ),
    )
}


def format_named(name: str) -> Format:
    """BadInput names those there are."""
    if name not in FORMATS:
        raise BadInput(f"no format of labels named {name!r}; there are {', '.join(FORMATS)}")
    return FORMATS[name]


def export_labels(labels: LabelSet, drive: Drive, name: str, out: Path) -> tuple[str, ...]:
    """Write labels of a drive as a new file or folder. Returns a sentence for each thing that the format cannot hold.

    BadInput when the labels are of another recording or cannot be, when ``out`` exists, or when the format needs what
    the recording has not (KITTI: a camera).
    """
    kind = format_named(name)
    placed = native.onto(check(labels, "these labels"), drive, "these labels")
    kept, lost = reduce(placed.labels, kind.holds)
    return (*placed.notes, *lost, *kind.write(kept, drive, out))


def import_labels(path: Path, drive: Drive, name: str, origin: Origin) -> Imported:
    """Read a file or folder as labels of a drive. BadInput in one sentence when it is none, or not of this drive."""
    kind = format_named(name)
    if not path.exists():
        raise BadInput(f"{path}: no such file")
    found = kind.read(path, drive, origin)
    labels = check(found.labels, str(path))
    check_extrinsic(labels, drive, str(path))
    return replace(found, labels=labels)
