"""The label database: SQLite in a local file, or a team's PostgreSQL.

A committed transaction is on disk: SQLite syncs its log (``synchronous=FULL``), and PostgreSQL does so by default.
Writers take turns: SQLite takes its single lock at the start, PostgreSQL locks the drive that an act changes.
"""

from __future__ import annotations

import logging
import os
import sqlite3
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, create_engine, event, inspect, text
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import URL, Engine, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError

from app.core.session_folder import SESSIONS
from app.labels import URL_VARIABLE
from app.labels.errors import DatabaseError
from app.labels.store.migrations import HEAD
from app.labels.store.tables import Base
from pipeline.common.errors import first_line

logger = logging.getLogger("cipv.labels")

FILE = SESSIONS / "labels.db"
_BUSY_S = 30.0
_AGAIN_S = 0.02
_CONNECT_S = 3
"""An unavailable server must not block: parameters are changed while driving."""
_MIGRATION_LOCK = 0x63697076
"""Arbitrary lock number that only this program uses in PostgreSQL."""


class Database:
    """An open database with the newest schema. Any thread, any number of processes."""

    def __init__(self, url: str | URL) -> None:
        """DatabaseError if it cannot be opened or is newer than this program."""
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        try:
            self.url = make_url(url)
            self._engine = _engine(self.url)
        except ImportError as error:
            brought = ", which `make install` installs" if error.name == "psycopg" else ""
            raise DatabaseError(f"labels: {error.name or error} is not installed{brought}") from None
        except (ArgumentError, NoSuchModuleError) as error:
            raise DatabaseError(f"labels: invalid database address: {first_line(error)}") from None
        self.is_sqlite = self._engine.dialect.name == "sqlite"
        with self.writing() as connection:
            if not self.is_sqlite:
                connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": _MIGRATION_LOCK})
            self._migrate(connection)

    @staticmethod
    def in_file(file: Path) -> Database:
        """SQLite; the folder is created. DatabaseError if it cannot be opened."""
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DatabaseError(f"{file}: labels cannot be stored there: {error.strerror}") from None
        return Database(URL.create("sqlite", database=str(file)))

    @staticmethod
    def temporary() -> Database:
        """A database that is deleted on closing."""
        folder = tempfile.TemporaryDirectory(prefix="cipv-labels-", ignore_cleanup_errors=True)
        database = Database.in_file(Path(folder.name) / "labels.db")
        database._folder = folder
        return database

    @property
    def name(self) -> str:
        """Display name: the file, or the address without its password."""
        return str(self.url.database) if self.is_sqlite else self.url.render_as_string(hide_password=True)

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A consistent snapshot for all queries in the block, whatever others write meanwhile. DatabaseError for any
        database error."""
        with self._speaking(), self._engine.connect() as connection:
            if not self.is_sqlite:  # SQLite's readers always have a snapshot
                connection.execution_options(isolation_level="REPEATABLE READ")
            with connection.begin():
                yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A transaction: committed at the end of the block, rolled back if it raises."""
        with self._speaking(), self._engine.connect().execution_options(writes=True) as connection, connection.begin():
            yield connection

    def insert_new(self, connection: Connection, table: type[Base], values: Mapping[str, Any]) -> bool:
        """Insert a row unless one with its key exists; returns whether it was inserted."""
        insert = sqlite.insert if self.is_sqlite else postgresql.insert
        made = insert(table).values(values).on_conflict_do_nothing().returning(*table.__table__.primary_key)
        return connection.execute(made).first() is not None

    def close(self) -> None:
        """Safe to call twice."""
        self._engine.dispose()
        if self._folder is not None:
            self._folder.cleanup()

    @contextmanager
    def _speaking(self) -> Iterator[None]:
        try:
            yield
        except DBAPIError as error:
            raise DatabaseError(f"labels, {self.name}: {first_line(error.orig or error)}") from None

    def _migrate(self, connection: Connection) -> None:
        """Upgrade to the newest schema, in the transaction."""
        at = None
        if inspect(connection).has_table("alembic_version"):
            at = connection.scalar(text("SELECT version_num FROM alembic_version"))
        if at != HEAD:
            migrate(connection, at, self.name)


def open_database(url: str | None = None) -> Database:
    """The database at ``url`` (or from the environment), else this machine's file. DatabaseError if it cannot be
    opened."""
    wanted = url or os.environ.get(URL_VARIABLE)
    return Database(wanted) if wanted else Database.in_file(FILE)


def migrate(connection: Connection, at: str | None, name: str) -> None:
    """Upgrade from revision ``at``, None for an empty database. DatabaseError for an unknown revision."""
    from alembic import command  # takes half a second to import, only needed at the first start
    from alembic.config import Config
    from alembic.script import ScriptDirectory

    config = Config()
    config.set_main_option("script_location", str(Path(__file__).parent / "migrations").replace("%", "%%"))
    config.attributes["connection"] = connection
    known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    if at is not None and at not in known:
        raise DatabaseError(f"labels, {name}: written by a newer version of this program")
    command.upgrade(config, HEAD)


def _engine(url: URL) -> Engine:
    if url.get_backend_name() == "sqlite":
        engine = create_engine(url, connect_args={"timeout": _BUSY_S, "check_same_thread": False})
        event.listen(engine, "connect", _as_sqlite)
        event.listen(engine, "begin", _begin_sqlite)
        return engine
    if url.get_backend_name() == "postgresql":
        if url.drivername == "postgresql":
            url = url.set(drivername="postgresql+psycopg")
        patience = f"-c lock_timeout={int(_BUSY_S * 1e3)}ms"
        return create_engine(url, pool_pre_ping=True, connect_args={"connect_timeout": _CONNECT_S, "options": patience})
    raise ArgumentError(f"{url.get_backend_name()}: labels are stored in sqlite or postgresql")


def _as_sqlite(connection: Any, _: Any) -> None:
    connection.isolation_level = None  # BEGIN is issued explicitly: the driver would start the transaction too late
    _write_ahead(connection)
    connection.execute("PRAGMA synchronous=FULL")
    connection.execute("PRAGMA foreign_keys=ON")


def _write_ahead(connection: Any) -> None:
    """Switch to the write-ahead log. While another connection switches a new file, SQLite fails immediately instead of
    waiting, so it is retried for as long as a writer would wait."""
    until_s = time.monotonic() + _BUSY_S
    while True:
        try:
            connection.execute("PRAGMA journal_mode=WAL")
            return
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode != sqlite3.SQLITE_BUSY or time.monotonic() > until_s:
                raise
            time.sleep(_AGAIN_S)


def _begin_sqlite(connection: Connection) -> None:
    writes = connection.get_execution_options().get("writes", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")
