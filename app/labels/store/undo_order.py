"""The order of undo: which act a person undoes or redoes next, and what prevents it."""

from __future__ import annotations

from typing import Any, Literal

from sqlalchemy import (
    BindParameter,
    ColumnElement,
    Connection,
    Select,
    String,
    and_,
    bindparam,
    func,
    or_,
    select,
    update,
)

from app.labels.store.tables import ActRow, ChangeRow

Way = Literal["undo", "redo"]
WAYS: tuple[Way, Way] = ("undo", "redo")
_OF_PARAMS = ("params", "nudge")


class Steps:
    """Undo steps of one drive, in the given transaction. station: owner of the parameters. Queries needed for every
    move of a slider are compiled once, because compiling takes longer than executing them."""

    def __init__(self, drive_id: int, station: str) -> None:
        self._drive_id, self._station = drive_id, station
        self._following = {way: self._select_following(way) for way in WAYS}
        self._possible = select(*(self._following[way].scalar_subquery() for way in WAYS))

    def _mine(self, person: str | BindParameter[str]) -> ColumnElement[bool]:
        """The acts that a person can undo or redo."""
        of_params = and_(ActRow.kind.in_(_OF_PARAMS), ActRow.station == self._station, ActRow.person.in_(("", person)))
        of_labels = and_(ActRow.kind.not_in((*_OF_PARAMS, *WAYS)), ActRow.person == person)
        return and_(ActRow.drive_id == self._drive_id, or_(of_params, of_labels))

    def _select_following(self, way: Way) -> Select[int]:
        mine = self._mine(bindparam("person", type_=String))
        if way == "undo":
            return select(func.max(ActRow.step)).where(mine, ActRow.status == "done")
        return select(func.min(ActRow.step)).where(mine, ActRow.status == "undone")

    def following(self, connection: Connection, way: Way, person: str) -> int | None:
        """The next step to undo or redo."""
        return connection.scalar(self._following[way], {"person": person})

    def possible(self, connection: Connection, person: str) -> tuple[bool, bool]:
        """(can undo, can redo) for a person, in one query."""
        undo, redo = connection.execute(self._possible, {"person": person}).one()
        return undo is not None, redo is not None

    def acts_of(self, connection: Connection, step: int) -> list[tuple[int, str]]:
        found = connection.execute(
            select(ActRow.number, ActRow.what)
            .where(ActRow.drive_id == self._drive_id, ActRow.step == step, ActRow.kind.not_in(WAYS))
            .order_by(ActRow.number)
        )
        return [(row.number, row.what) for row in found]

    def drop_redo(self, connection: Connection, person: str) -> None:
        """A new act discards the acts that could be redone."""
        connection.execute(update(ActRow).where(self._mine(person), ActRow.status == "undone").values(status="dropped"))

    def before(self, connection: Connection, number: int, person: str, names: set[str]) -> int | None:
        """The step of act ``number`` if it changed the same parameters; else None."""
        row = connection.execute(
            select(ActRow.step, ActRow.kind, ActRow.person, ActRow.station, ActRow.status).where(
                ActRow.drive_id == self._drive_id, ActRow.number == number
            )
        ).first()
        if row is None or tuple(row[1:]) != ("nudge", person, self._station, "done"):
            return None
        before = connection.scalars(
            select(ChangeRow.item).where(ChangeRow.drive_id == self._drive_id, ChangeRow.act == number)
        )
        return row.step if set(before) == names else None

    def changed_since(self, connection: Connection, change: Any, person: str) -> str | None:
        """The last other person who changed the same item after ``change``; None if nobody did. For parameters, only
        effective acts on this station by named persons count."""
        wanted = [
            ChangeRow.drive_id == self._drive_id,
            ChangeRow.kind == change.kind,
            ChangeRow.item == change.item,
            ChangeRow.act > change.act,
            ActRow.person != person,
        ]
        if change.kind == "param":
            wanted += [
                ActRow.status == "done",
                ActRow.kind.not_in(WAYS),
                ActRow.station == self._station,
                ActRow.person != "",
            ]
        return connection.scalars(
            select(ActRow.person)
            .join(ChangeRow, and_(ActRow.drive_id == ChangeRow.drive_id, ActRow.number == ChangeRow.act))
            .where(*wanted)
            .order_by(ActRow.number.desc())
            .limit(1)
        ).first()
