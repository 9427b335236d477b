"""Reads labels of one drive from the database."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any, cast

from sqlalchemy import Connection, and_, func, select

from app.labels.store.tables import ActRow, ChangeRow, ItemRow, SightingRow
from app.labels.store.values import Item, ItemKind, Value, sighting_of, unpack_content, value_from_json
from pipeline.labels.model import Sighting

SIGHTINGS = tuple(SightingRow.__table__.columns)
"""In the table's order, which is that of ``values.row_of``."""
_MOST_NAMED = 500
"""Maximum ids in one query: databases limit this."""


def read_items(connection: Connection, drive_id: int, kind: ItemKind) -> dict[int, Item]:
    """Every existing item of a kind, by its id."""
    found = connection.execute(
        select(ItemRow.id, ItemRow.revision, ItemRow.value)
        .where(ItemRow.drive_id == drive_id, ItemRow.kind == kind, ItemRow.removed.is_(False))
        .order_by(ItemRow.id)
    )
    return {row.id: _item(kind, row) for row in found}


def read_item(connection: Connection, drive_id: int, kind: ItemKind, number: int) -> Item | None:
    """None if it does not exist, or no longer does."""
    row = connection.execute(
        select(ItemRow.id, ItemRow.revision, ItemRow.value).where(
            ItemRow.drive_id == drive_id, ItemRow.kind == kind, ItemRow.id == number, ItemRow.removed.is_(False)
        )
    ).first()
    return _item(kind, row) if row is not None else None


def read_changed(connection: Connection, drive_id: int, since: int) -> tuple[list[Item], list[tuple[ItemKind, int]]]:
    """(existing items, kind and id of removed items) changed by acts after ``since``."""
    found = connection.execute(
        select(ItemRow.kind, ItemRow.id, ItemRow.revision, ItemRow.removed, ItemRow.value)
        .where(ItemRow.drive_id == drive_id, ItemRow.revision > since)
        .order_by(ItemRow.kind, ItemRow.id)
    ).all()
    items = [_item(cast("ItemKind", row.kind), row) for row in found if not row.removed]
    return items, [(cast("ItemKind", row.kind), row.id) for row in found if row.removed]


def read_track(
    connection: Connection, drive_id: int, track: int, first: int | None = None, last: int | None = None
) -> dict[int, Sighting]:
    """A track's sightings by ascending frame, limited to ``first`` … ``last`` if given."""
    wanted = select(*SIGHTINGS).where(SightingRow.drive_id == drive_id, SightingRow.track == track)
    if first is not None:
        wanted = wanted.where(SightingRow.frame >= first)
    if last is not None:
        wanted = wanted.where(SightingRow.frame <= last)
    found = connection.execute(wanted.order_by(SightingRow.frame))
    return {sighting.frame: sighting for sighting in map(sighting_of, found)}


def read_window(connection: Connection, drive_id: int, first: int, last: int) -> Iterator[tuple[int, Sighting]]:
    """(track, sighting) of every track in frames first … last, by frame."""
    found = connection.execute(
        select(*SIGHTINGS)
        .where(SightingRow.drive_id == drive_id, SightingRow.frame.between(first, last))
        .order_by(SightingRow.frame, SightingRow.track)
    )
    for row in found:
        yield row[2], sighting_of(row)


def read_extents(
    connection: Connection, drive_id: int, tracks: Iterable[int]
) -> dict[int, tuple[int, int, int, list[int]]]:
    """For each track with sightings: first frame, last frame, number of sightings, and its keyframes."""
    wanted = list(tracks)
    whole = len(wanted) > _MOST_NAMED
    extent = select(SightingRow.track, func.min(SightingRow.frame), func.max(SightingRow.frame), func.count()).where(
        SightingRow.drive_id == drive_id
    )
    keys = select(SightingRow.track, SightingRow.frame).where(
        SightingRow.drive_id == drive_id, SightingRow.keyframe.is_(True)
    )
    if not whole:
        extent, keys = extent.where(SightingRow.track.in_(wanted)), keys.where(SightingRow.track.in_(wanted))
    found: dict[int, tuple[int, int, int, list[int]]] = {
        track: (first, last, count, []) for track, first, last, count in connection.execute(extent.group_by("track"))
    }
    for track, frame in connection.execute(keys.order_by(SightingRow.track, SightingRow.frame)):
        found[track][3].append(frame)
    return found


@dataclass(frozen=True)
class Change:
    """Changes by one act to items of one kind."""

    person: str
    """Person of the act."""
    before: list[Value]
    """Changed or removed items, before the act."""
    after: list[Value]
    """Changed or added items, after the act."""


def read_changes_of_others(
    connection: Connection, drive_id: int, kind: ItemKind, since: int, person: str
) -> Iterator[Change]:
    """Changes by the acts of all other persons after ``since`` to items of a kind, by act."""
    rows = connection.execute(
        select(ActRow.number, ActRow.person, ChangeRow.before, ChangeRow.after)
        .join(ChangeRow, and_(ActRow.drive_id == ChangeRow.drive_id, ActRow.number == ChangeRow.act))
        .where(ChangeRow.drive_id == drive_id, ChangeRow.act > since, ChangeRow.kind == kind, ActRow.person != person)
        .order_by(ActRow.number)
    ).all()
    for (_, who), changed in groupby(rows, key=lambda row: (row.number, row.person)):
        both = [(unpack_content(kind, row.before).value, unpack_content(kind, row.after).value) for row in changed]
        before, after = zip(*both, strict=True)
        yield Change(who, [each for each in before if each], [each for each in after if each])


def _item(kind: ItemKind, row: Any) -> Item:
    return Item(kind, row.id, row.revision, value_from_json(kind, json.loads(row.value)))
