"""How much each person has done on each recording: acts and active time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from sqlalchemy import select

from app.labels.store.database import Database
from app.labels.store.tables import ActRow, DriveRow

_PAUSE_S = 120.0
"""A longer pause does not count as work."""
_NO_ACTS = ("params", "nudge")


@dataclass(frozen=True)
class Effort:
    """Work of one person on one recording."""

    title: str
    """The recording."""
    frames: int
    """Its number of frames."""
    person: str
    """Name of the person."""
    acts: int
    """Changes of labels, including undo and redo."""
    active_s: float
    """Total time between acts, without pauses of more than two minutes."""
    key: str
    """The recording's key, derived from its content."""

    @property
    def acts_per_frame(self) -> float:
        return self.acts / self.frames

    @property
    def s_per_frame(self) -> float:
        return self.active_s / self.frames


def efforts(database: Database) -> list[Effort]:
    """Sorted by recording and person."""
    with database.reading() as connection:
        rows = connection.execute(
            select(DriveRow.key, DriveRow.title, DriveRow.count, ActRow.person, ActRow.t_unix_ms)
            .join(DriveRow, DriveRow.id == ActRow.drive_id)
            .where(DriveRow.count > 0, ActRow.kind.not_in(_NO_ACTS))
            .order_by(DriveRow.title, DriveRow.id, ActRow.person, ActRow.number)
        ).all()
    found: dict[tuple[Any, ...], list[int]] = {}
    for key, title, count, person, t_unix_ms in rows:
        found.setdefault((key, title, count, person), []).append(t_unix_ms)
    return [
        Effort(title, count, person, len(times), _active_s(times), key)
        for (key, title, count, person), times in found.items()
    ]


def _active_s(times_ms: Sequence[int]) -> float:
    steps = ((after - before) / 1e3 for before, after in pairwise(sorted(times_ms)))
    return sum(step for step in steps if step <= _PAUSE_S)
