"""An event of a drive, and the data in which events are found."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from numpy.lib.recfunctions import repack_fields

from app.drive.frame_rows import Objects, Row
from pipeline.common.clips import begins_clip
from pipeline.params import Params

Severity = Literal["info", "notice", "warning", "alarm"]
OBJECT_FIELDS = ["id", "carried", "in_path", "path_offset_m", "vl_gap_m", "vl_gap_sigmas"]
"""The fields of ``frame_rows.OBJECT`` that finders may use: 18 of its 125 bytes, so that a batch can hold the objects
of a drive of many hours."""


def event_fields(records: Objects) -> Objects:
    """A copy of a frame's objects, with ``OBJECT_FIELDS`` only."""
    return repack_fields(records[OBJECT_FIELDS])


@dataclass(frozen=True)
class Event:
    """Something that happened on a drive. Object ids are those of the run."""

    kind: str
    """One of ``app.drive.events.event_kinds()``."""
    index: int
    """The frame at which it happened."""
    text: str
    """What changed, as a sentence."""
    ids: tuple[int, ...] = ()
    """The objects involved, the most important first."""
    severity: Severity = "info"
    """Defines colour and order in the list."""
    mark: int | None = None
    """Number of a user's mark; None for other events and for marks that are part of the recording, which cannot be
    removed."""

    def to_json(self, t_s: float) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "index": self.index,
            "t_s": t_s,
            "text": self.text,
            "ids": list(self.ids),
            "severity": self.severity,
            "mark": self.mark,
        }


class RunRows(NamedTuple):
    """Frames 0 … N−1 of one run, and its parameters."""

    rows: Sequence[Row]
    """One per frame."""
    objects: Sequence[Objects]
    """Objects of each frame, by object id, with ``OBJECT_FIELDS`` only."""
    params: Params
    """Parameters whose limits the events use."""

    def starts_anew(self, index: int) -> bool:
        """Whether all trackers were reset at a frame, as after a gap in the recording."""
        gap_s = self.params.time.reset_gap_s
        return index == 0 or begins_clip(self.rows[index - 1].t_ns, self.rows[index].t_ns, gap_s)


class EventFinder(NamedTuple):
    """One function that finds events."""

    kinds: tuple[str, ...]
    """The kinds of event that it can find."""
    find: Callable[[RunRows], Iterable[Event]]
    """Processes a run and returns its events."""


def ids(*numbers: int | None) -> tuple[int, ...]:
    """The given object ids that are not None."""
    return tuple(number for number in numbers if number is not None)
