"""Marks as events: those in the recording, and those that people added."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.drive.events.event import Event
from app.drive.marks import SavedMark
from pipeline.types import I64
from pipeline.types.source import Mark


def recorded_marks(t_ns: Sequence[int], marks: Sequence[Mark]) -> list[Event]:
    """Marks made during the recording, at their frames; marks whose frames are not in ``t_ns`` are left out. t_ns: the
    frames' ticks."""
    index_of = {tick: index for index, tick in enumerate(t_ns)}
    return [Event("mark", index_of[mark.t_ns], mark.text) for mark in marks if mark.t_ns in index_of]


def marks_by_time(marks: Sequence[SavedMark], t_ns: I64, within_ns: int) -> list[Event]:
    """Marks made with live sensors, at the frames with the nearest timestamps within ``within_ns``. Marks of other
    times, and those that are part of a session, are left out. t_ns: (N,) the frames' timestamps."""
    found = []
    for mark in marks:
        if mark.t_ns is None or mark.in_session or not len(t_ns):
            continue
        index = int(np.argmin(np.abs(t_ns - mark.t_ns)))
        if abs(int(t_ns[index]) - mark.t_ns) <= within_ns:
            found.append(Event("mark", index, mark.text or "marked"))
    return found
