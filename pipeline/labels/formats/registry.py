"""Every format by name, and the two things that are done with one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pipeline.common.errors import BadInput
from pipeline.common.garbage_collection import gc_paused
from pipeline.labels.formats import coco, lead_csv, native, session
from pipeline.labels.formats.base import Format, FormatName, Imported, LabeledDrive, check_extrinsic
from pipeline.labels.formats.kitti.files import files as kitti
from pipeline.labels.formats.nuscenes.write import read as nuscenes_read
from pipeline.labels.formats.nuscenes.write import write as nuscenes
from pipeline.labels.formats.openlabel.write import read as openlabel_read
from pipeline.labels.formats.openlabel.write import write as openlabel
from pipeline.labels.formats.parts import EVERYTHING, Part, reduce
from pipeline.labels.model import LabelSet, Origin
from pipeline.labels.validate import check

_SHAPES: frozenset[Part] = frozenset(("cuboids", "boxes"))
_TRACKED: frozenset[Part] = frozenset(("cuboids", "identities"))
_BOXES: frozenset[Part] = frozenset(("boxes", "identities"))
_LEADS: frozenset[Part] = frozenset(("leads", "states", "origins", "comments", "reviews"))

FORMATS: dict[FormatName, Format] = {
    each.name: each
    for each in (
        Format("native", EVERYTHING, native.write, native.read),
        Format("mcap", EVERYTHING, session.write, session.read),
        Format("openlabel", EVERYTHING, openlabel.write, openlabel_read.read),
        Format("kitti", _SHAPES, kitti.write_objects, kitti.read_objects),
        Format("kitti-tracking", _SHAPES | {"identities"}, kitti.write_tracking, kitti.read_tracking),
        Format("nuscenes", _TRACKED, nuscenes.write, nuscenes_read.read),
        Format("coco", _BOXES, coco.write, coco.read),
        Format("csv", _LEADS, lead_csv.write, lead_csv.read),
    )
}


def export_labels(labels: LabelSet, drive: LabeledDrive, name: FormatName, out: Path) -> tuple[str, ...]:
    """Write labels of a drive as a new file or folder. Returns a sentence for each thing that the format cannot hold.

    BadInput when the labels are of another recording or cannot be, when ``out`` exists, or when the format needs what
    the recording has not (KITTI: a camera).
    """
    kind = FORMATS[name]
    with gc_paused():
        placed = native.onto(check(labels, "these labels"), drive, "these labels")
        kept, lost = reduce(placed.labels, kind.holds)
        return (*placed.notes, *lost, *kind.write(kept, drive, out))


def import_labels(path: Path, drive: LabeledDrive, name: FormatName, origin: Origin) -> Imported:
    """Read a file or folder as labels of a drive. BadInput in one sentence when it is none, or not of this drive."""
    kind = FORMATS[name]
    if not path.exists():
        raise BadInput(f"{path}: no such file")
    with gc_paused():
        found = kind.read(path, drive, origin)
        labels = check(found.labels, str(path))
        check_extrinsic(labels, drive, str(path))
        return replace(found, labels=labels)
