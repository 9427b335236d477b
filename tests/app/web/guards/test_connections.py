"""Clients that never finish a request do not affect others."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from urllib.parse import urlsplit

import httpx
import pytest

from app.web.guards import connections
from app.web.server import create_app
from tests.app.web.serving import WAIT_S, running, serving


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with running() as engine, serving(create_app(engine)) as address:
        yield address


def half_open(address: str, said: bytes = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n") -> socket.socket:
    parts = urlsplit(address)
    client = socket.create_connection((parts.hostname or "", parts.port or 0), timeout=WAIT_S)
    client.sendall(said)
    return client


def hangs_up(client: socket.socket) -> bool:
    """Whether the server closes the connection."""
    try:
        return client.recv(100) == b""
    except ConnectionResetError:
        return True


@pytest.mark.parametrize(
    "said", [b"", b"GET /healthz HTTP/1.1\r\nX: ", b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nGET /"]
)
def test_who_does_not_end_a_header_is_hung_up_on(address: str, said: bytes, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(connections, "HEADER_S", 0.2)
    with half_open(address, said) as client:
        while not hangs_up(client):
            pass  # the answer to what was whole


def test_a_body_that_does_not_come_is_not_waited_for(address: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(connections, "BODY_S", 0.2)
    head = b"POST /api/playback HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\n{"
    with half_open(address, head) as client:
        assert hangs_up(client)


def test_too_many_make_room_for_who_says_what_they_want(address: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(connections, "MOST_CONNECTIONS", 20)
    clients = [half_open(address) for _ in range(60)]
    try:
        for _ in range(3):
            assert httpx.get(f"{address}/healthz", timeout=WAIT_S).status_code == 200
        assert all(hangs_up(client) for client in clients[:40]), "the oldest first"
        clients[-1].sendall(b"\r\n")
        assert clients[-1].recv(100).startswith(b"HTTP/1.1 200"), "the newest may still go on"
    finally:
        for client in clients:
            client.close()
