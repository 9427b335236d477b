"""The database: its schema, how it is opened, and the error if it cannot be opened."""

from __future__ import annotations

import json
import re
import sys
import threading
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import select, text

from app.labels.store import migrations
from app.labels.store.database import Database, DatabaseError, open_database
from app.labels.store.drive_labels import DriveLabels
from app.labels.store.tables import Base, DriveRow
from app.labels.store.values import pack
from tests.app.labels.conftest import fresh, info


def test_the_migrations_make_the_tables_as_they_are_declared(database: Database) -> None:
    with database.reading() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []


def test_the_newest_migration_is_the_one_that_is_worked_with() -> None:
    config = Config()
    config.set_main_option("script_location", str(Path(migrations.__file__).parent))
    assert ScriptDirectory.from_config(config).get_heads() == [migrations.HEAD]


def test_what_is_committed_is_on_disk(sqlite_database: Database) -> None:
    """The log is flushed to disk before a commit returns."""
    with sqlite_database.reading() as connection:
        assert connection.scalar(text("PRAGMA journal_mode")) == "wal"
        assert connection.scalar(text("PRAGMA synchronous")) == 2


def test_two_that_open_a_new_database_at_once_both_can(file: Path) -> None:
    opened: list[Database] = []

    def one() -> None:
        opened.append(Database.in_file(file))

    threads = [threading.Thread(target=one) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {DriveLabels(each, info("drive")).revision for each in opened} == {0}
    assert len(opened) == 4
    for each in opened:
        each.close()


def test_a_database_of_a_newer_program_is_left_alone(file: Path) -> None:
    first = Database.in_file(file)
    with first.writing() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    first.close()
    with pytest.raises(DatabaseError, match="written by a newer version of this program"):
        Database.in_file(file)


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("nonsense", "invalid database address"),
        ("mysql://somewhere/labels", "invalid database address"),
        ("sqlite:////nowhere/at/all/labels.db", "unable to open"),
        ("postgresql://me:secret@127.0.0.1:1/labels", "127.0.0.1:1"),
    ],
)
def test_an_address_that_cannot_be_opened_is_said_without_its_password(url: str, says: str) -> None:
    with pytest.raises(DatabaseError) as error:
        Database(url)
    assert says in str(error.value)
    assert "secret" not in str(error.value)


@pytest.mark.parametrize(
    ("url", "driver", "says"),
    [
        ("postgresql://me@host/labels", "psycopg", "psycopg is not installed, which `make install` installs"),
        ("postgresql+pg8000://me@host/labels", "pg8000", "pg8000 is not installed"),
    ],
)
def test_a_driver_that_is_missing_is_said(url: str, driver: str, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, driver, None)
    with pytest.raises(DatabaseError) as error:
        Database(url)
    assert str(error.value) == f"labels: {says}"


ROOT = Path(__file__).parents[4]


def test_what_make_install_is_said_to_bring_is_in_the_lock() -> None:
    locked = (ROOT / "requirements.lock").read_text()
    assert re.search("^psycopg==", locked, re.MULTILINE)
    assert re.search("^trackeval==", locked, re.MULTILINE)


def test_nobody_is_told_to_install_this_program_from_where_it_is_not() -> None:
    files = [file for folder in ("app", "pipeline", "static") for file in (ROOT / folder).rglob("*.[pjm][ysd]")]
    assert len(files) > 300
    assert [file.name for file in (ROOT / "README.md", *files) if "cipv-studio[" in file.read_text()] == []


def test_a_file_that_is_no_database_is_said(file: Path) -> None:
    file.write_bytes(b"these are no labels" * 100)
    with pytest.raises(DatabaseError, match="not a database"):
        Database.in_file(file)
    (file.parent / "a file").write_text("")
    with pytest.raises(DatabaseError, match="labels cannot be stored there"):
        Database.in_file(file.parent / "a file" / "labels.db")


def test_the_environment_names_the_database_of_a_team(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CIPV_LABELS_URL", f"sqlite:///{file}")
    database = open_database()
    assert (database.name, file.is_file()) == (str(file), True)
    database.close()


def test_a_database_at_the_newest_schema_is_opened_as_it_is(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The migration library takes half a second to import, so it is imported only when needed."""
    Database.in_file(file).close()

    def migrate(*_: object) -> None:
        raise AssertionError("there is nothing to change")

    monkeypatch.setattr("app.labels.store.database.migrate", migrate)
    Database.in_file(file).close()


def test_a_reader_has_one_view_whatever_others_write(database: Database) -> None:
    labels = DriveLabels(database, fresh())
    with database.reading() as connection:
        before = [list(connection.execute(select(DriveRow.revision).order_by(DriveRow.id)))]
        labels.log.settle({"a.b": (1, 2)})
        before.append(list(connection.execute(select(DriveRow.revision).order_by(DriveRow.id))))
    assert before[0] == before[1]
    assert labels.revision == 1


def test_a_database_of_an_older_program_goes_on(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parameters changed on the machine are those of its usual server."""
    monkeypatch.setattr("app.labels.store.database.HEAD", "0001")
    old = Database.in_file(file)
    key = info("drive").key
    with old.writing() as connection:
        for statement in (
            f"INSERT INTO drive VALUES (1, '{key}', 'test:drive', 'a drive', 100, 1)",
            "INSERT INTO act VALUES (1, 1, 'params', 'a.b 1 → 2', 'Ada', 'here', 0, 1, 'done', NULL)",
        ):
            connection.exec_driver_sql(statement)
        body = {"before": pack(1), "after": pack(2)}
        connection.execute(text("INSERT INTO change VALUES (1, 1, 'param', 'a.b', :before, :after)"), body)
    old.close()
    monkeypatch.undo()
    new = Database.in_file(file)
    labels = DriveLabels(new, info("drive"), station="here:8420")
    assert labels.log.move("undo", "Ada", act_id="1").params == {"a.b": 1}
    new.close()


def test_the_newest_version_of_an_older_database_is_known(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.labels.store.database.HEAD", "0008")
    old = Database.in_file(file)
    with old.writing() as connection:
        for drive in (1, 2):
            connection.exec_driver_sql(f"INSERT INTO drive VALUES ({drive}, 'key {drive}', 'test:drive', 'x', 100, 1)")
        for previous, sha256 in (("", "a"), ("a", "b"), ("b", "c")):
            values = f"1, '{sha256}', 'Ada', 5, 0, 0, :labels, '{previous}', '{sha256}', '', ''"
            connection.execute(text(f"INSERT INTO version VALUES ({values})"), {"labels": b""})
    old.close()
    monkeypatch.undo()
    new = Database.in_file(file)
    with new.reading() as connection:
        assert connection.execute(text("SELECT drive_id, sha256, signature FROM newest_version")).all() == [
            (1, "c", "")
        ]
    new.close()


@pytest.fixture(params=["sqlite", "postgres"])
def nowhere(request: pytest.FixtureRequest, file: Path) -> str:
    """The address of a database without tables."""
    if request.param == "sqlite":
        return f"sqlite:///{file}"
    url: str = request.getfixturevalue("postgres_url")
    return url


def test_tags_of_single_frames_become_ranges(nowhere: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both current tags and undo steps; the second tag was removed."""
    monkeypatch.setattr("app.labels.store.database.HEAD", "0002")
    old = Database(nowhere)
    origin = {"maker": "person", "name": "Ada", "t_unix_ms": 5, "params": None, "calibration": None, "how": ""}
    tags = [{"frame": frame, "tag": tag, "origin": origin} for frame, tag in ((3, "night"), (4, "rain"))]
    night, rain = (pack({"value": each, "frames": [], "sightings": []}) for each in tags)
    with old.writing() as connection:
        connection.exec_driver_sql(f"INSERT INTO drive VALUES (1, '{info('drive').key}', 'test:drive', 'x', 100, 3)")
        for number, (item, before, after) in enumerate(((1, None, night), (2, None, rain), (2, rain, None)), 1):
            act = f"(1, {number}, 'tag', 'x', 'Ada', 'here', 0, {number}, 'done', NULL, NULL, '')"
            connection.exec_driver_sql(f"INSERT INTO act VALUES {act}")
            body = {"before": before, "after": after}
            row = f"(1, {number}, 'tag', '{item}', :before, :after)"
            connection.execute(text(f"INSERT INTO change VALUES {row}"), body)
        for item, revision in ((1, 1), (2, 3)):
            row = f"(1, 'tag', {item}, {revision}, :removed, :value)"
            there = {"removed": item == 2, "value": json.dumps(tags[item - 1])}
            connection.execute(text(f"INSERT INTO item VALUES {row}"), there)
    old.close()
    monkeypatch.undo()
    new = Database(nowhere)
    labels = DriveLabels(new, info("drive"), station="here")
    assert [(each.first, each.last, each.tag) for each in labels.label_set().tags] == [(3, 3, "night")]
    labels.log.move("undo", "Ada")
    assert [(each.first, each.last, each.tag) for each in labels.label_set().tags] == [(3, 3, "night"), (4, 4, "rain")]
    new.close()
