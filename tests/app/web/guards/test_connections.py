"""Clients that never finish a handshake or a request, or never take a response, do not affect others."""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
from fastapi import FastAPI
from fastapi.responses import Response

from app.web.guards import connections
from app.web.server import create_app
from app.web.tls_files import TlsFiles
from tests.app.web.serving import WAIT_S, certificate, running, serving


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


def test_who_is_between_two_requests_is_not_hung_up_on_for_those_who_end_none(
    address: str, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(connections, "MOST_CONNECTIONS", 20)
    with ExitStack() as stack:
        page = stack.enter_context(half_open(address, b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"))
        assert page.recv(100).startswith(b"HTTP/1.1 200")
        clients = [stack.enter_context(half_open(address)) for _ in range(60)]
        assert all(hangs_up(client) for client in clients[:41])
        page.sendall(b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert any(b"HTTP/1.1 200" in data for data in iter(lambda: page.recv(1000), b""))


@pytest.mark.parametrize(
    "said",
    [
        b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"POST /api/playback HTTP/1.1\r\nHost: elsewhere\r\nContent-Length: 9\r\n\r\n",
    ],
    ids=["asked nothing more", "never sent the body"],
)
def test_too_many_who_are_answered_make_room(address: str, said: bytes, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(connections, "MOST_CONNECTIONS", 20)
    with ExitStack() as stack:
        for _ in range(20):
            assert stack.enter_context(half_open(address, said)).recv(9) == b"HTTP/1.1 "
        for _ in range(3):
            assert httpx.get(f"{address}/healthz", timeout=WAIT_S).status_code == 200


LARGE = b"a" * (16 << 20)
"""More than the system keeps for a client that does not read."""


@pytest.fixture(scope="module")
def large() -> Iterator[str]:
    """The address of a server with a large file and a small one."""
    app = FastAPI()
    app.add_api_route("/large", lambda: Response(LARGE))
    app.add_api_route("/small", lambda: Response(b"a"))
    with serving(app) as address:
        yield address


WITHOUT_READING = b"GET /large HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"


def test_too_many_who_take_nothing_of_a_response_make_room(large: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(connections, "MOST_CONNECTIONS", 8)
    with ExitStack() as stack:
        clients = [stack.enter_context(half_open(large, WITHOUT_READING)) for _ in range(8)]
        for client in clients:
            assert client.recv(9) == b"HTTP/1.1 ", "its response is under way"
        for _ in range(6):
            assert httpx.get(f"{large}/small", timeout=WAIT_S).status_code == 200


def test_who_takes_nothing_of_a_response_is_hung_up_on(large: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(connections, "STALLED_S", 0.2)
    is_dropped, drop = threading.Event(), connections.LimitedProtocol.drop
    monkeypatch.setattr(connections.LimitedProtocol, "drop", lambda self: (drop(self), is_dropped.set()))
    with half_open(large, WITHOUT_READING) as client:
        assert is_dropped.wait(WAIT_S)
        assert sum(len(data) for data in iter(lambda: client.recv(1 << 20), b"")) < len(LARGE)


@pytest.fixture(scope="module")
def over_tls(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, ssl.SSLContext]]:
    """The address of a server over HTTPS, and what a client needs to trust it."""
    files = certificate(tmp_path_factory.mktemp("tls"))
    with serving(FastAPI(), TlsFiles(*map(Path, files)).context()) as address:
        yield address, ssl.create_default_context(cafile=str(files[0]))


def answers(address: str, tls: ssl.SSLContext) -> bool:
    with httpx.Client(verify=tls, timeout=WAIT_S) as client:
        return client.get(address).status_code == 404


def test_who_does_not_shake_hands_makes_room_too(over_tls: tuple[str, ssl.SSLContext], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(connections, "MOST_CONNECTIONS", 20)
    with ExitStack() as stack:
        clients = [stack.enter_context(half_open(over_tls[0], b"")) for _ in range(60)]
        assert answers(*over_tls)
        assert all(hangs_up(client) for client in clients[:40]), "the oldest first"


@pytest.mark.parametrize("said", [b"", b"\x16\x03\x01\x02\x00", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"])
def test_who_does_not_shake_hands_is_hung_up_on(
    over_tls: tuple[str, ssl.SSLContext], said: bytes, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(connections, "HEADER_S", 0.2)
    with half_open(over_tls[0], said) as client:
        while not hangs_up(client):
            pass  # TLS names the error first
    monkeypatch.undo()
    assert answers(*over_tls)


def test_a_request_that_comes_with_the_end_of_the_handshake_is_answered(over_tls: tuple[str, ssl.SSLContext]):
    address, tls = over_tls
    parts = urlsplit(address)
    into, out = ssl.MemoryBIO(), ssl.MemoryBIO()
    client = tls.wrap_bio(into, out, server_hostname=parts.hostname)
    with half_open(address, b"") as plain:
        while True:
            try:
                client.do_handshake()
                break
            except ssl.SSLWantReadError:
                plain.sendall(out.read())
                into.write(plain.recv(1 << 16))
        client.write(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        plain.sendall(out.read())  # its last message of the handshake and the request in one packet
        while True:
            try:
                assert client.read(12) == b"HTTP/1.1 404"
                break
            except ssl.SSLWantReadError:
                into.write(plain.recv(1 << 16))
