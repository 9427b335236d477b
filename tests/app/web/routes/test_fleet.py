"""/api/fleet: the answers are those of the tables, and nothing else can be reached."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from app.bench.fleet_tables import make_tables
from app.fleet.desk import FleetDesk
from app.fleet.find import FleetTables
from app.fleet.store import Store
from app.web.server import create_app
from tests.app.web.serving import WAIT_S, running, serving


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fleet")
    make_tables(folder, 3)
    return folder


@pytest.fixture(scope="module")
def client(out: Path) -> Iterator[httpx.Client]:
    with (
        running() as engine,
        serving(create_app(engine, fleet=FleetDesk(str(out)))) as address,
        httpx.Client(base_url=address, timeout=WAIT_S) as client,
    ):
        yield client


def test_rows_histograms_and_counts_are_those_of_the_tables(client: httpx.Client, out: Path):
    tables = FleetTables(Store(str(out)))
    about = client.get("/api/fleet").json()
    assert (about["address"], about["runs"]) == (str(out), [tables.run])
    assert about["about"] == {tables.run: "default parameters"}
    asked = {"of": "frames", "where": "distance_m < 20"}
    rows = client.get("/api/fleet/rows", params=asked | {"order": "distance_m", "limit": 7}).json()
    expected = tables.find("distance_m < 20", "frames", 7, order="distance_m")
    assert (rows["columns"], rows["rows"]) == ([*expected.columns], [[*row] for row in expected.rows])
    assert (rows["total"], len(rows["rows"])) == (expected.total, 7)
    histogram = client.get("/api/fleet/histogram", params=asked | {"column": "speed_mps", "bins": 5}).json()
    edges, counts = tables.histogram("distance_m < 20", "frames", "speed_mps", 5)
    assert (histogram["edges"], histogram["counts"]) == (edges, counts)
    found = client.get("/api/fleet/counts", params={"column": "kind", "where": "close"}).json()
    assert [(each["value"], each["count"]) for each in found] == tables.counts("close", "events", "kind")


REFUSED = {
    "a wrong condition": ("rows", {"where": "no_such > 1"}, 409, "no_such"),
    "another file": (
        "rows",
        {"where": "drive IN (SELECT content FROM read_text('/etc/passwd'))"},
        409,
        "Cannot access",
    ),
    "a second statement": ("rows", {"where": "true); DROP VIEW events; SELECT (true"}, 409, "one condition"),
    "a wrong column": ("histogram", {"column": "no_such"}, 409, "no_such"),
    "a column that is more": ("counts", {"column": 'kind", (SELECT 1)'}, 409, "kind"),
    "words, not numbers": ("histogram", {"column": "text"}, 409, "convert"),
    "another run": ("rows", {"run": "../x"}, 409, "no run"),
    "a run with a NUL": ("rows", {"run": "a\0b"}, 409, "no run"),
    "another table": ("rows", {"of": "duckdb_settings"}, 422, "of"),
    "too many rows": ("rows", {"limit": "100000"}, 422, "limit"),
    "a long condition": ("rows", {"where": "x" * 5000}, 422, "where"),
}


@pytest.mark.parametrize("asked", REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_asked_is_refused_in_a_sentence(
    client: httpx.Client, asked: tuple[str, dict[str, str], int, str]
):
    what, query, status, words = asked
    answer = client.get(f"/api/fleet/{what}", params=query)
    assert answer.status_code == status
    assert words.lower() in answer.json()["detail"].lower()


def test_without_a_fleet():
    with (
        running() as engine,
        serving(create_app(engine)) as address,
        httpx.Client(base_url=address, timeout=WAIT_S) as client,
    ):
        assert client.get("/api/fleet").json()["address"] is None
        answer = client.get("/api/fleet/rows")
        assert (answer.status_code, "--fleet" in answer.json()["detail"]) == (404, True)
