"""Projects in the label database."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import Connection, delete, select, update

from app.labels.projects.project_file import ProjectFile
from app.labels.store.database import Database
from app.labels.store.tables import ControlRow, DriveRow, ProjectDriveRow, ProjectRow


@dataclass(frozen=True)
class ControlSpan:
    """Control frames to store."""

    key: str
    """Key of the recording."""
    first: int
    """First frame."""
    last: int
    """Last frame, included."""
    truth: bytes
    """See ``control.pack_truth``."""


def put_project(
    database: Database, file: ProjectFile, keys: Sequence[str], control: Iterable[ControlSpan], person: str
) -> None:
    """Store a project in one transaction, in place of an earlier one of this name; a recording leaves the project that
    it was in. keys: of its recordings, which are in the database."""
    entries = file.entries
    values = {
        "name": entries.name,
        "classes": file.classes,
        "sampling": entries.sampling.text if entries.sampling is not None else "",
        "person": person,
        "t_unix_ms": int(time.time() * 1000),
    }
    with database.writing() as connection:
        if not database.insert_new(connection, ProjectRow, values):
            connection.execute(update(ProjectRow).where(ProjectRow.name == entries.name).values(values))
        members = select(ProjectDriveRow.drive_id).where(ProjectDriveRow.project == entries.name)
        connection.execute(delete(ControlRow).where(ControlRow.drive_id.in_(members)))
        connection.execute(delete(ProjectDriveRow).where(ProjectDriveRow.project == entries.name))
        numbers = _numbers(connection, keys)
        for number in numbers.values():
            connection.execute(delete(ControlRow).where(ControlRow.drive_id == number))
            connection.execute(delete(ProjectDriveRow).where(ProjectDriveRow.drive_id == number))
            database.insert_new(connection, ProjectDriveRow, {"drive_id": number, "project": entries.name})
        for span in control:
            row = {"drive_id": numbers[span.key], "first": span.first, "last": span.last, "truth": span.truth}
            database.insert_new(connection, ControlRow, row)


def projects(database: Database) -> dict[str, str]:
    """The sampling of each project, in words, by its name."""
    with database.reading() as connection:
        rows = connection.execute(select(ProjectRow.name, ProjectRow.sampling).order_by(ProjectRow.name)).all()
    return {row.name: row.sampling for row in rows}


def _numbers(connection: Connection, keys: Sequence[str]) -> Mapping[str, int]:
    found: dict[str, int] = {}
    for key in keys:
        found[key] = connection.scalars(select(DriveRow.id).where(DriveRow.key == key)).one()
    return found
