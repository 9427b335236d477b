"""Whose decision each label is: that person cannot review it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import cast

from sqlalchemy import ColumnElement, Connection, and_, func, select

from app.labels.store.tables import ActRow, ChangeRow
from app.labels.store.undo_order import WAYS
from app.labels.store.values import Item, ItemKind, unpack_content
from pipeline.labels.model import COUNTED_STATES, FrameTag, LeadRange

_REVIEWS = ("review_ok", "send_back")
"""Acts that judge a label without changing it."""
_MOST_NAMED = 500
"""Maximum ids in one query: databases limit this."""


def read_authors(connection: Connection, drive_id: int, items: Iterable[Item]) -> dict[tuple[ItemKind, int], str]:
    """The author of each of these items, by kind and id: the person who set it or, if the pipeline or a file made it,
    who accepted or imported it. Who only cut it at its ends, split or merged its track, or reviewed it, is not its
    author. Proposals that nobody has accepted have none; tags neither."""
    found: dict[tuple[ItemKind, int], str] = {}
    decided: dict[ItemKind, list[int]] = {}
    for item in items:
        value = item.value
        if isinstance(value, FrameTag):
            continue
        if value.origin.maker == "person":
            found[item.kind, item.id] = value.origin.name
        elif value.state in COUNTED_STATES:
            decided.setdefault(item.kind, []).append(item.id)
    for kind, numbers in decided.items():
        by = _lead_deciders(connection, drive_id) if kind == "lead" else _deciders(connection, drive_id, kind, numbers)
        found |= {(kind, number): by[number] for number in numbers if number in by}
    return found


def _effective(drive_id: int, kind: ItemKind) -> ColumnElement[bool]:
    """Changes by acts that decided something: undone acts, undos and reviews do not count."""
    return and_(
        ChangeRow.drive_id == drive_id,
        ChangeRow.kind == kind,
        ActRow.drive_id == ChangeRow.drive_id,
        ActRow.number == ChangeRow.act,
        ActRow.status == "done",
        ActRow.kind.not_in((*WAYS, *_REVIEWS)),
    )


def _deciders(connection: Connection, drive_id: int, kind: ItemKind, numbers: Sequence[int]) -> dict[int, str]:
    """Person of the last effective act on each item."""
    counted = _effective(drive_id, kind)
    if len(numbers) <= _MOST_NAMED:
        counted = and_(counted, ChangeRow.item.in_([str(number) for number in numbers]))
    last = select(ChangeRow.item, func.max(ChangeRow.act).label("act")).where(counted).group_by(ChangeRow.item)
    newest = last.subquery()
    rows = connection.execute(
        select(newest.c.item, ActRow.person).where(ActRow.drive_id == drive_id, ActRow.number == newest.c.act)
    )
    return {int(row.item): row.person for row in rows}


def _lead_deciders(connection: Connection, drive_id: int) -> dict[int, str]:
    """Like ``_deciders``, but what an act leaves of a range that it cut stays the decision of whoever made it."""
    rows = connection.execute(
        select(ActRow.number, ActRow.person, ChangeRow.item, ChangeRow.before, ChangeRow.after)
        .where(_effective(drive_id, "lead"))
        .order_by(ActRow.number)
    ).all()
    found: dict[int, str] = {}
    for (_, person), changes in groupby(rows, key=lambda row: (row.number, row.person)):
        pairs = [(int(row.item), _range(row.before), _range(row.after)) for row in changes]
        before = [(number, old) for number, old, _ in pairs if old is not None]
        by = {
            number: next((found[whole] for whole, old in before if whole in found and _is_part(new, old)), person)
            for number, _, new in pairs
            if new is not None
        }
        found |= by
    return found


def _range(data: bytes | None) -> LeadRange | None:
    return cast("LeadRange | None", unpack_content("lead", data).value)


def _is_part(new: LeadRange, old: LeadRange) -> bool:
    """Whether the range is what is left of another one; its track may have another number since."""
    return (new.origin, new.state) == (old.origin, old.state) and old.first <= new.first and new.last <= old.last
