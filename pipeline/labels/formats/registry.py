"""Every label format, declared once, and the export and import of labels with one.

A new format is one file with ``write`` and ``read``, and one entry in ``FORMATS``; the commands' ``--format``, the API
and the page list the formats here. A format's modules are imported on use.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pipeline.common.errors import BadInput
from pipeline.common.garbage_collection import gc_paused
from pipeline.labels.classes import NO_CLASSES, ClassList, as_written, default_classes
from pipeline.labels.formats.base import Imported, LabeledDrive, ReadLabels, Write, check_extrinsic
from pipeline.labels.formats.parts import EVERYTHING, Part, reduce
from pipeline.labels.model import LabelSet, Origin
from pipeline.labels.validate import check


@dataclass(frozen=True)
class LabelFormat:
    """One file or folder format for labels."""

    name: str
    """Name in commands, the API and stored choices."""
    title: str
    """Display name."""
    about: str
    """Short description."""
    suffix: str
    """File suffix; empty if the format is a folder, which is transferred as a .zip."""
    holds: frozenset[Part]
    """Supported content; the rest of a label set is left out, with a note."""
    writer: str
    """``module:function`` that writes labels, see ``base.Write``."""
    reader: str
    """``module:function`` that reads them back, see ``base.Read``."""
    as_stored: bool = False
    """Own format: boxes that follow cuboids are computed by the reader."""

    def write(self, labels: LabelSet, drive: LabeledDrive, out: Path) -> tuple[str, ...]:
        """Write labels that contain only supported content. Returns sentences about changed content."""
        write: Write = _imported(self.writer)
        return write(labels, drive, out)

    def read(self, path: Path, drive: LabeledDrive, origin: Origin) -> Imported:
        """Read the file or folder; ``origin`` is used if the file does not say who made a label. BadInput in one
        sentence if it cannot be read."""
        read: ReadLabels = _imported(self.reader)
        return read(path, drive, origin)


def _imported(name: str) -> Any:
    module, _, function = name.partition(":")
    return getattr(import_module(module), function)


_OURS = "pipeline.labels.formats"
_SHAPES: frozenset[Part] = frozenset(("cuboids", "boxes"))
_TRACKED: frozenset[Part] = frozenset(("cuboids", "identities"))
_BOXES: frozenset[Part] = frozenset(("boxes", "identities"))
_LEADS: frozenset[Part] = frozenset(("leads", "states", "origins", "comments", "reviews"))

FORMATS: dict[str, LabelFormat] = {
    each.name: each
    for each in (
        LabelFormat("native", "CIPV Studio", "all labels", ".json", EVERYTHING,
               f"{_OURS}.native:write", f"{_OURS}.native:read", as_stored=True),
        LabelFormat("mcap", "MCAP session", "labels as a channel", ".mcap", EVERYTHING,
               f"{_OURS}.session:write", f"{_OURS}.session:read", as_stored=True),
        LabelFormat("openlabel", "OpenLABEL", "ASAM OpenLABEL 1.0", ".json", EVERYTHING - {"attributes"},
               f"{_OURS}.openlabel.write:write", f"{_OURS}.openlabel.read:read"),
        LabelFormat("nuscenes", "nuScenes", "JSON tables", "", _TRACKED,
               f"{_OURS}.nuscenes.write:write", f"{_OURS}.nuscenes.read:read"),
        LabelFormat("kitti", "KITTI object", "one file per frame", "", _SHAPES,
               f"{_OURS}.kitti.files:write_objects", f"{_OURS}.kitti.files:read_objects"),
        LabelFormat("kitti-tracking", "KITTI tracking", "single file", "", _SHAPES | {"identities"},
               f"{_OURS}.kitti.files:write_tracking", f"{_OURS}.kitti.files:read_tracking"),
        LabelFormat("coco", "COCO", "image boxes", ".json", _BOXES,
               f"{_OURS}.coco:write", f"{_OURS}.coco:read"),
        LabelFormat("csv", "CSV", "lead per frame", ".csv", _LEADS,
               f"{_OURS}.lead_csv:write", f"{_OURS}.lead_csv:read"),
    )
}  # fmt: skip
"""By name, in the order shown on the page."""

if TYPE_CHECKING:
    FormatName = str
else:
    FormatName = Literal[tuple(FORMATS)]
"""The names as a type, for the choices of commands and the API."""


def export_labels(
    labels: LabelSet, drive: LabeledDrive, name: FormatName, out: Path, classes: ClassList | None = None
) -> tuple[str, ...]:
    """Write labels of a drive to a new file or folder. Returns a sentence for everything that the format cannot
    represent, or names differently. classes: the project's; None for the defaults.

    BadInput if the labels belong to another recording or are invalid, if ``out`` exists, or if the recording lacks
    something that the format requires (KITTI: a camera).
    """
    from pipeline.labels.boxes import following
    from pipeline.labels.formats.native import onto  # pydantic's adapter of a whole label set

    kind = FORMATS[name]
    with gc_paused():
        placed = onto(check(labels, "these labels"), drive, "these labels")
        follows = "boxes" in kind.holds and not kind.as_stored
        whole = following(placed.labels, drive) if follows else placed.labels
        called, renamed = as_written(whole, classes or default_classes(), name)
        kept, lost = reduce(called, kind.holds)
        return (*placed.notes, *lost, *renamed, *kind.write(kept, drive, out))


def import_labels(
    path: Path, drive: LabeledDrive, name: FormatName, origin: Origin, classes: ClassList = NO_CLASSES
) -> Imported:
    """Read a file or folder as labels of a drive. BadInput in one sentence if it does not have this format, or belongs
    to another drive. classes: the project's, whose names in this format are read back; without it, names are read as
    detectors name things."""
    kind = FORMATS[name]
    if not path.exists():
        raise BadInput(f"{path}: no such file")
    with gc_paused():
        found = kind.read(path, replace(drive, classes=classes), origin)
        labels = check(found.labels, str(path))
        check_extrinsic(labels, drive, str(path))
        return replace(found, labels=labels)
