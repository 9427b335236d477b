"""The events of a drive, found in its frame rows and objects by pure functions.

To add a kind of event, write one module in this folder with an ``EventFinder`` and register it in ``FINDERS``. If it
needs another field of the objects, add that to ``OBJECT_FIELDS``.
"""

from __future__ import annotations

from collections.abc import Sequence

from app.drive.events import danger, lead, sensors
from app.drive.events.event import OBJECT_FIELDS, Event, EventFinder, RunRows
from app.drive.frame_rows import Objects, Row
from pipeline.params import Params

FINDERS: list[EventFinder] = [
    lead.FINDER,
    danger.TTC_FINDER,
    danger.BRAKING_FINDER,
    sensors.DISAGREEMENT_FINDER,
    sensors.GAP_FINDER,
]


def event_kinds() -> tuple[str, ...]:
    """Every kind of event. Marks are not included, because users make them."""
    return (*(kind for finder in FINDERS for kind in finder.kinds), "mark")


def find_events(rows: Sequence[Row], objects: Sequence[Objects], params: Params) -> list[Event]:
    """Every event of one run, ordered by frame. objects: of each frame; fields other than ``OBJECT_FIELDS`` are
    ignored."""
    run = RunRows(rows, [records[OBJECT_FIELDS] for records in objects[: len(rows)]], params)
    found = [event for finder in FINDERS for event in finder.find(run)]
    return sorted(found, key=lambda event: (event.index, event.kind, event.ids))
