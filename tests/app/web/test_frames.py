"""Frames as they come to each page over its stream."""

from __future__ import annotations

from collections.abc import Callable

import httpx
from websockets.sync.client import ClientConnection

from app.engine.engine import Engine
from tests.app.web.asking import next_frame, next_text, reach


def test_whoever_joins_late_gets_the_current_frame_at_once(
    client: httpx.Client, engine: Engine, stream: Callable[..., ClientConnection]
):
    client.post("/api/playback", json={"seek": 9})
    reach(engine, lambda s: s.index == 9)
    for _ in range(2):
        with stream() as socket:
            assert next_frame(socket)["result"]["frame"] == "000009"


def test_a_frame_reaches_every_client(client: httpx.Client, stream: Callable[..., ClientConnection]):
    with stream() as one, stream() as other:
        next_frame(one)
        next_frame(other)
        client.post("/api/playback", json={"seek": 4})
        assert next_frame(one) == next_frame(other)


def test_a_page_that_paints_slowly_is_sent_nothing_ahead_and_then_the_newest(
    client: httpx.Client, stream: Callable[..., ClientConnection]
):
    with stream("?paced=1") as slow, stream() as reader:
        next_frame(reader)
        for index in range(1, 9):
            client.post("/api/playback", json={"seek": index})
            while next_frame(reader)["state"]["index"] != index:
                pass
        got = [next_frame(slow)["state"]["index"] for _ in range(2)]
        assert got[-1] < 8, "what it had not asked for was not sent ahead"
        slow.send('{"painted": true}')
        assert next_frame(slow)["state"]["index"] == 8


def test_a_change_without_a_new_frame_is_told_too(client: httpx.Client, stream: Callable[..., ClientConnection]):
    with stream() as socket:
        next_frame(socket)
        client.post("/api/playback", json={"loop": False, "speed": 2.0})
        assert next_text(socket, lambda m: m["state"]["speed"] == 2.0)


def test_a_ping_comes_back_with_the_servers_clock_and_rubbish_is_ignored(stream: Callable[..., ClientConnection]):
    with stream() as socket:
        for rubbish in ("", "{", "[1]", '{"ping": "x"}', '{"ping": NaN}', "[" * 5000):
            socket.send(rubbish)
        socket.send('{"ping": 17.5}')
        pong = next_text(socket, lambda m: m["type"] == "pong")
        assert pong["ping"] == 17.5
        assert pong["server_unix_ms"] > 1.6e12
