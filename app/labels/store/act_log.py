"""The log of acts on a drive: each act is one transaction and one row, and can be undone and redone.

People undo their own acts, newest first, and never another person's; an undo is refused where both changed the same
label. Parameters belong to the server that they were changed on (``station``); a change without a person's name counts
as everyone's there. An act may carry an id chosen by its sender: sent a second time, it is not applied again.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection, and_, insert, select, update

from app.labels.errors import ActRefused
from app.labels.store.database import Database
from app.labels.store.draft import Draft, name_of
from app.labels.store.invariants import check_whole
from app.labels.store.tables import ActRow, ChangeRow, DriveRow
from app.labels.store.undo_order import Steps, Way
from app.labels.store.values import HistoryEntry, ItemKind, unpack, unpack_pair

_LONGEST_HISTORY = 200


@dataclass(frozen=True)
class Acted:
    """Result of an act."""

    revision: int
    """Revision of the drive after the act."""
    act: int | None
    """Its number; None when nothing changed."""
    what: str
    """The act in words, for undo and history."""
    note: str = ""
    """Additional information."""
    params: Mapping[str, Any] = field(default_factory=dict)
    """New values of this program's parameters, by name."""


@dataclass
class _Turn:
    """An act in progress. is_logged: its row is written."""

    connection: Connection
    draft: Draft
    is_logged: bool = False


Apply = Callable[[Draft], str]
"""Changes labels in a draft and returns a short description: ``moved #7 in frame 12``."""


class Log:
    """The act log of one drive. Any thread."""

    def __init__(self, database: Database, drive_id: int, station: str | None = None) -> None:
        self._database, self._drive_id = database, drive_id
        self._station = socket.gethostname() if station is None else station
        self._steps = Steps(drive_id, self._station)

    # ------------------------------------------------------------ doing

    def act(self, kind: str, person: str, apply: Apply, *, act_id: str | None = None, note: str = "") -> Acted:
        """Perform an act; it is on disk when this returns. If ``apply`` raises, nothing changes. If an act with this
        ``act_id`` exists, its result is returned."""
        with self._turn(person) as turn:
            connection, draft = turn.connection, turn.draft
            done = self._sent_before(connection, act_id, person)
            if done is not None:
                return done
            what = apply(draft)
            check_whole(draft)
            if not draft.write():
                return Acted(draft.number - 1, None, "nothing changed", note)
            self._steps.drop_redo(connection, person)
            self._write(turn, kind, what, act_id=act_id, note=note)
            return Acted(draft.number, draft.number, what, note)

    def sent_before(self, act_id: str | None, person: str) -> Acted | None:
        """The result of an earlier act with this id; None if there is none. ActRefused if it is another person's."""
        with self._database.reading() as connection:
            return self._sent_before(connection, act_id, person)

    def settle(self, changes: Mapping[str, tuple[Any, Any]], person: str = "", *, merges: bool = False) -> None:
        """Log changed parameters, by name: before and after. merges: undone together with the previous change, if that
        changed the same parameters and was merging, too."""
        if not changes:
            return
        with self._turn(person) as turn:
            connection, draft = turn.connection, turn.draft
            for name, (before, after) in changes.items():
                draft.put_param(name, before, after)
            if not draft.write():
                return
            step = self._steps.before(connection, draft.number - 1, person, set(changes)) if merges else None
            self._steps.drop_redo(connection, person)
            named = ", ".join(f"{name} {_short(old)} → {_short(new)}" for name, (old, new) in list(changes.items())[:3])
            more = f" and {len(changes) - 3} more" if len(changes) > 3 else ""
            self._write(turn, "nudge" if merges else "params", named + more, step=step)

    # ------------------------------------------------------------ undo and redo

    def move(
        self,
        way: Way,
        person: str,
        check: Callable[[Mapping[str, Any]], object] = lambda _: None,
        *,
        act_id: str | None = None,
    ) -> Acted:
        """Undo the person's newest act, or redo the one undone last. ActRefused if there is none, or if somebody else
        has changed the same label or parameter since. check: raises for invalid parameters. act_id: see ``act``."""
        with self._turn(person) as turn:
            connection, draft = turn.connection, turn.draft
            done = self._sent_before(connection, act_id, person)
            if done is not None:
                return done
            step = self._steps.following(connection, way, person)
            if step is None:
                raise ActRefused(f"nothing to {way}")
            acts = self._steps.acts_of(connection, step)
            for number, _ in reversed(acts) if way == "undo" else acts:
                self._put(connection, draft, number, way)
            check(draft.params)
            check_whole(draft)
            draft.write()
            what = acts[-1][1]
            status = "undone" if way == "undo" else "done"
            connection.execute(
                update(ActRow)
                .where(ActRow.drive_id == self._drive_id, ActRow.number.in_([number for number, _ in acts]))
                .values(status=status)
            )
            said = f"undone: {what}" if way == "undo" else f"redone: {what}"
            self._write(turn, way, said, target=step, act_id=act_id)
            return Acted(draft.number, draft.number, what, params=draft.params)

    def possible(self, person: str) -> tuple[bool, bool]:
        """(can undo, can redo) for a person."""
        with self._database.reading() as connection:
            return self._steps.possible(connection, person)

    # ------------------------------------------------------------ history

    def history(self, kind: ItemKind, number: int) -> list[HistoryEntry]:
        """The acts that changed an item, newest first."""
        with self._database.reading() as connection:
            found = connection.execute(
                select(ActRow, ChangeRow.before, ChangeRow.after)
                .join(ActRow, and_(ActRow.drive_id == ChangeRow.drive_id, ActRow.number == ChangeRow.act))
                .where(ChangeRow.drive_id == self._drive_id, ChangeRow.kind == kind, ChangeRow.item == str(number))
                .order_by(ActRow.number.desc())
                .limit(_LONGEST_HISTORY)
            ).all()
        return [
            HistoryEntry(
                row.number,
                row.what,
                row.note,
                row.person,
                row.t_unix_ms,
                unpack(row.before) if row.before is not None else None,
                unpack(row.after) if row.after is not None else None,
                row.status != "done",
            )
            for row in found
        ]

    # ------------------------------------------------------------ transaction

    @contextmanager
    def _turn(self, person: str) -> Iterator[_Turn]:
        """The transaction of an act. Its first statement serialises the acts of one drive; if the act's row was not
        written, everything is rolled back."""
        with self._database.writing() as connection:
            number = connection.execute(
                update(DriveRow)
                .where(DriveRow.id == self._drive_id)
                .values(revision=DriveRow.revision + 1)
                .returning(DriveRow.revision)
            ).scalar_one()
            turn = _Turn(connection, Draft(connection, self._drive_id, number, person, int(time.time() * 1000)))
            yield turn
            if not turn.is_logged:
                connection.get_transaction().rollback()  # type: ignore[union-attr]

    def _write(
        self,
        turn: _Turn,
        kind: str,
        what: str,
        *,
        step: int | None = None,
        target: int | None = None,
        act_id: str | None = None,
        note: str = "",
    ) -> None:
        draft, turn.is_logged = turn.draft, True
        turn.connection.execute(
            insert(ActRow).values(
                drive_id=self._drive_id,
                number=draft.number,
                kind=kind,
                what=what,
                person=draft.person,
                station=self._station,
                t_unix_ms=draft.t_unix_ms,
                step=step or draft.number,
                status="done",
                target=target,
                act_id=act_id,
                note=note,
            )
        )

    def _sent_before(self, connection: Connection, act_id: str | None, person: str) -> Acted | None:
        if act_id is None:
            return None
        row = connection.execute(
            select(ActRow.number, ActRow.what, ActRow.note, ActRow.person, ActRow.target).where(
                ActRow.drive_id == self._drive_id, ActRow.act_id == act_id
            )
        ).first()
        if row is None:
            return None
        if row.person != person:
            raise ActRefused("another person's act has this id")
        what = row.what if row.target is None else self._steps.acts_of(connection, row.target)[-1][1]
        return Acted(row.number, row.number, what, row.note)

    def _put(self, connection: Connection, draft: Draft, act: int, way: Way) -> None:
        """Restore the state before an act (undo) or after it (redo). ActRefused if an item differs from the state after
        the act (undo) or before it (redo), because that would revert another person's change."""
        rows = connection.execute(
            select(ChangeRow).where(ChangeRow.drive_id == self._drive_id, ChangeRow.act == act)
        ).all()
        for row in rows:
            here, there = (row.after, row.before) if way == "undo" else (row.before, row.after)
            if row.kind == "param":
                if (other := self._steps.changed_since(connection, row, draft.person)) is not None:
                    raise ActRefused(f"{other} changed {row.item} since; {way} would revert that too")
                draft.put_param(row.item, unpack(here), unpack(there))
                continue
            kind: ItemKind = row.kind
            number = int(row.item)
            was, to = unpack_pair(kind, here, there)
            if not draft.stands(kind, number, was):
                other = self._steps.changed_since(connection, row, draft.person) or "somebody"
                raise ActRefused(f"{other} changed {name_of(kind, number)} since; {way} would revert that too")
            draft.put(kind, number, to.value)
            if kind == "track":
                draft.put_sightings(number, to.frames)


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
