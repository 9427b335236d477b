"""Two people label one recording at random: on one server, and on two servers with one database. CIPV_TWO_PEOPLE_ACTS
says how many acts each of them does; a hundred by default."""

from __future__ import annotations

import os

from app.labels.store.database import Database
from tests.app.labels.server_process import forking, started
from tests.app.labels.two_people import Hand, at_once, check_the_end

ACTS = int(os.environ.get("CIPV_TWO_PEOPLE_ACTS", "100"))


def label_together(addresses: tuple[str, str]) -> None:
    hands = [Hand("Ada", addresses[0], 1), Hand("Bob", addresses[1], 2)]
    at_once(hands, ACTS)
    check_the_end(hands)
    told = hands[0].told + hands[1].told
    print({hand.name: dict(hand.told) for hand in hands})
    assert told["done"] > ACTS, "most of what they do is done"
    assert told["conflict"], "they get in each other's way, and are told"


def test_two_people_on_one_server_lose_nothing_without_being_told(tmp_path) -> None:  # type: ignore[no-untyped-def]
    with forking() as context:
        server, address = started(context, tmp_path / "labels.db")
        try:
            label_together((address, address))
        finally:
            server.terminate()
            server.join()


def test_two_people_on_two_servers_of_one_postgresql_lose_nothing_without_being_told(
    postgres_url: str, postgres_database: Database
) -> None:
    with forking() as context:
        servers = [started(context, postgres_url) for _ in range(2)]
        try:
            label_together((servers[0][1], servers[1][1]))
        finally:
            for server, _ in servers:
                server.terminate()
                server.join()
