"""Two people label one recording at random: on one server, and on two servers with one database. ``make soak`` does the
same with a thousand acts of each person."""

from __future__ import annotations

from pathlib import Path

from tests.app.labels.server_process import forking, started
from tests.app.labels.two_people import label_together

ACTS = 60


def test_two_people_on_one_server_lose_nothing_without_being_told(tmp_path: Path) -> None:
    with forking() as context:
        server, address = started(context, tmp_path / "labels.db")
        try:
            label_together((address, address), ACTS)
        finally:
            server.terminate()
            server.join()


def test_two_people_on_two_servers_of_one_postgresql_lose_nothing_without_being_told(postgres_url: str) -> None:
    with forking() as context:
        servers = [started(context, postgres_url) for _ in range(2)]
        try:
            label_together((servers[0][1], servers[1][1]), ACTS)
        finally:
            for server, _ in servers:
                server.terminate()
                server.join()
