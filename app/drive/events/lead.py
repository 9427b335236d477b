"""Events of the lead: acquired, switched, lost, cut in, cut out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from app.drive.events.event import Event, EventFinder, RunRows, ids
from app.drive.frame_rows import Objects
from pipeline.types import seeing_sensors_in_words

LONGEST_LOOK_BACK = 30
"""Number of frames before a change that are searched for an object's earlier position inside or outside the path."""
BESIDE_FRAMES = 3
"""To count as a cut-in, an object must have been seen beside the path in this many frames before."""


def lead_changes(run: RunRows) -> Iterator[Event]:
    """Each frame whose CIPV differs from the previous frame's, as the most specific kind of event."""
    seen: set[int] = set()
    last: int | None = None
    for index, row in enumerate(run.rows):
        now = row.cipv_id
        last = None if run.starts_anew(index) else last
        if now != last:
            yield _lead_change(run, index, last, now, seen)
        if now is not None:
            seen.add(now)
        last = now


def _lead_change(run: RunRows, index: int, last: int | None, now: int | None, seen: set[int]) -> Event:
    row = run.rows[index]
    left = last is not None and _left_the_path(run, index, last)
    if now is None:
        assert last is not None
        if left:
            return Event("cut_out", index, f"#{last} left the path; nothing ahead", (last,), "notice")
        return Event("cipv_lost", index, f"#{last} is no longer the CIPV; nothing ahead", (last,), "notice")
    at = f"{row.distance_m:.1f} m" if row.distance_m is not None else "unknown distance"
    nearer = _nearer_than_before(run, index)
    if nearer and _was_beside(run, index, now):
        before = f" before #{last}" if last is not None else ""
        return Event("cut_in", index, f"#{now} cut in{before} at {at}", ids(now, last), "warning")
    if last is not None and left:
        return Event("cut_out", index, f"#{last} left the path; #{now} at {at} is the CIPV now", (last, now), "notice")
    if last is not None:
        return Event("cipv_switch", index, f"CIPV #{last} → #{now} at {at}", (now, last), "notice")
    if now in seen:
        return Event("cipv_switch", index, f"#{now} is the CIPV again at {at}", (now,), "info")
    seen_by = seeing_sensors_in_words(row.source or "")
    return Event("first_acquisition", index, f"#{now} acquired at {at} by {seen_by}", (now,), "info")


def _left_the_path(run: RunRows, index: int, object_id: int) -> bool:
    """Whether an object still exists and is now beside the path."""
    record = _record(run.objects[index], object_id)
    return record is not None and not record["in_path"] and not np.isnan(record["path_offset_m"])


def _was_beside(run: RunRows, index: int, object_id: int) -> bool:
    """Whether an object was seen beside the path shortly before."""
    beside = 0
    for before in range(index - 1, max(-1, index - 1 - LONGEST_LOOK_BACK), -1):
        record = _record(run.objects[before], object_id)
        if record is not None and not record["in_path"] and not record["carried"]:
            beside += not np.isnan(record["path_offset_m"])
    return beside >= BESIDE_FRAMES


def _nearer_than_before(run: RunRows, index: int) -> bool:
    """Whether the CIPV is nearer than the last one was; also true if there was none."""
    before, now = run.rows[index - 1].distance_m if index else None, run.rows[index].distance_m
    return before is None or (now is not None and now < before)


def _record(records: Objects, object_id: int) -> np.void | None:
    match = np.flatnonzero(records["id"] == object_id)
    return records[match[0]] if len(match) else None


FINDER = EventFinder(("first_acquisition", "cipv_switch", "cipv_lost", "cut_in", "cut_out"), lead_changes)
