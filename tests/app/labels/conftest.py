"""Labels are tested on both databases: each test has a drive of its own, without labels."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from app.engine.engine import Engine
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveInfo, DriveLabels
from tests.app.labels import postgres
from tests.app.labels.site import act, team

COUNT = 100
_numbers = itertools.count()


def fresh() -> DriveInfo:
    """A recording that no other test uses."""
    return info(f"drive {next(_numbers)}")


def info(key: str, count: int = COUNT) -> DriveInfo:
    """A made-up recording at 10 Hz."""
    names = tuple(f"{index:06d}" for index in range(count))
    return DriveInfo(key, f"test:{key}", "a drive", tuple(index * 100_000_000 for index in range(count)), lambda: names)


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[str]:
    """URL of a server that runs only for these tests; skipped without PostgreSQL's programs, but never in CI."""
    found = postgres.binaries()
    if found is None:
        assert os.environ.get("CIPV_BROWSER_TESTS") != "1", "PostgreSQL is not installed, and these tests may not skip"
        pytest.skip("no PostgreSQL here (apt-get install postgresql)")
    with postgres.running(found) as url:
        yield url


@pytest.fixture
def postgres_url(postgres_server: str) -> str:
    """URL of a database without tables that no other test uses."""
    return postgres.new_database(postgres_server, f"test_{next(_numbers)}")


@pytest.fixture(scope="session")
def sqlite_database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    database = Database.in_file(tmp_path_factory.mktemp("labels") / "labels.db")
    yield database
    database.close()


@pytest.fixture(scope="session")
def postgres_database(postgres_server: str) -> Iterator[Database]:
    database = Database(postgres_server)
    yield database
    database.close()


@pytest.fixture(params=["sqlite", "postgres"])
def database(request: pytest.FixtureRequest) -> Database:
    """Both databases, one after the other."""
    found: Database = request.getfixturevalue(f"{request.param}_database")
    return found


@pytest.fixture
def labels(database: Database) -> DriveLabels:
    """A drive without labels."""
    return DriveLabels(database, fresh(), station="here")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "labels.db"


@pytest.fixture(scope="module")
def server() -> Iterator[tuple[Engine, httpx.Client]]:
    with team() as both:
        yield both


@pytest.fixture
def engine(server: tuple[Engine, httpx.Client]) -> Engine:
    return server[0]


@pytest.fixture
def client(server: tuple[Engine, httpx.Client]) -> httpx.Client:
    """Nothing is labelled at the start of each test."""
    found = server[1]
    there = found.get("/api/labels").json()
    items = [
        {"kind": kind, "id": each["id"], "revision": each["revision"]}
        for kind in ("track", "lead", "path", "event", "tag")
        for each in there[f"{kind}s"]
    ]
    if items:
        assert act(found, "broom", kind="remove", items=items).is_success
    return found
