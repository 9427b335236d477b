"""Two people label one recording at random, a thousand acts each: on one server, and on two servers with one
PostgreSQL. The figures are written to ``build/soak_together.json``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.app.labels.conftest import postgres_server, postgres_url  # noqa: F401
from tests.app.labels.server_process import forking, started
from tests.app.labels.two_people import label_together

pytestmark = pytest.mark.soak

ACTS = 1000
REPORT = Path("build/soak_together.json")


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("servers", [1, 2])
def test_a_thousand_acts_each_lose_nothing_without_being_told(
    servers: int, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    where = tmp_path / "labels.db" if servers == 1 else request.getfixturevalue("postgres_url")
    with forking() as context:
        running = [started(context, where) for _ in range(servers)]
        try:
            told = label_together((running[0][1], running[-1][1]), ACTS)
        finally:
            for server, _ in running:
                server.terminate()
                server.join()
    REPORT.parent.mkdir(exist_ok=True)
    known = json.loads(REPORT.read_text(encoding="utf-8")) if REPORT.exists() else {}
    REPORT.write_text(json.dumps(known | {f"{servers} servers": told}, indent=2) + "\n", encoding="utf-8")
    print(servers, told)
