"""Columns of the timeline that only the dashboard reads, not the server.

To add one, write a function of a frame and its result in its own module and register it in ``EXTRA_COLUMNS``. Its name
becomes a key of ``columns`` in ``GET /api/drive``.
"""

from __future__ import annotations

from collections.abc import Callable

from pipeline.types import Frame, Result

ColumnValue = int | float | str | bool | None


def _next_cipv_id(frame: Frame, result: Result) -> int | None:
    return result.next_cipv.id if result.next_cipv else None


def _objects(frame: Frame, result: Result) -> int:
    return len(result.objects)


def _notes(frame: Frame, result: Result) -> int:
    return len(result.notes)


EXTRA_COLUMNS: dict[str, Callable[[Frame, Result], ColumnValue]] = {
    "next_cipv_id": _next_cipv_id,
    "objects": _objects,
    "notes": _notes,
}
