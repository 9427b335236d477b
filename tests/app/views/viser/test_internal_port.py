"""viser's own port answers no one but the proxy."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import ExitStack, suppress

import httpx
import pytest
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from app.views.viser import internal_port
from app.views.viser.internal_port import HEADERS, demanding_the_secret
from app.views.viser.view import ViserView
from pipeline.params import Params


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    view = ViserView(Params())
    yield view.port
    view.close()


STRANGERS: dict[str, dict[str, str]] = {
    "a program": {},
    "a page of another origin": {"origin": "http://evil.example"},
    "a page of the dashboard's own origin, past the proxy": {"origin": "http://127.0.0.1:8420"},
    "a guess": dict.fromkeys(HEADERS, "x" * 43),
}


@pytest.mark.parametrize("name", STRANGERS)
def test_a_stranger_gets_neither_page_nor_scene(port: int, name: str):
    assert httpx.get(f"http://127.0.0.1:{port}/", headers=STRANGERS[name], trust_env=False).status_code == 403
    with pytest.raises(InvalidStatus, match="403"):
        connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            additional_headers=STRANGERS[name],
            proxy=None,
        )


def test_the_proxy_gets_both(port: int):
    assert httpx.get(f"http://127.0.0.1:{port}/", headers=HEADERS, trust_env=False).status_code == 200
    subprotocols = [Subprotocol(f"viser-v{viser.__version__}")]
    with connect(f"ws://127.0.0.1:{port}", subprotocols=subprotocols, additional_headers=HEADERS, proxy=None) as scene:
        assert scene.recv(10.0)


def test_strangers_who_only_connect_make_room_for_the_proxy(port: int):
    with ExitStack() as stack:
        strangers = [stack.enter_context(socket.create_connection(("127.0.0.1", port), 60)) for _ in range(60)]
        assert httpx.get(f"http://127.0.0.1:{port}/", headers=HEADERS, trust_env=False).status_code == 200
        for stranger in strangers[: -internal_port.MOST_NEWCOMERS]:
            with suppress(ConnectionResetError):
                assert stranger.recv(1) == b"", "the oldest are hung up on"


def test_a_server_that_was_started_without_it_is_an_error():
    with pytest.raises(RuntimeError, match="without the check"), demanding_the_secret():
        pass
    assert internal_port.websockets.asyncio.server.serve.__module__ == "websockets.asyncio.server"
