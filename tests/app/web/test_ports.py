"""The port that is listened on."""

from __future__ import annotations

import asyncio
import socket

import pytest

from app.core.server_address import PortTaken, listen_socket
from tests.app.waiting import loop_apart


def test_small_messages_are_not_held_back():
    """asyncio sets TCP_NODELAY on accepted sockets only if the listening socket specifies its protocol."""

    async def accepted_delay() -> int:
        loop = asyncio.get_running_loop()
        found: asyncio.Future[int] = loop.create_future()

        class Probe(asyncio.Protocol):
            def connection_made(self, transport: asyncio.BaseTransport) -> None:
                accepted = transport.get_extra_info("socket")
                found.set_result(accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
                transport.close()

        bound = listen_socket("127.0.0.1", 0)
        async with await loop.create_server(Probe, sock=bound):
            _, writer = await asyncio.open_connection(*bound.getsockname())
            no_delay = await found
            writer.close()
            await writer.wait_closed()
            return no_delay

    with loop_apart() as run:
        assert run(accepted_delay())


def test_a_taken_port_is_said_or_passed_over():
    held = listen_socket("127.0.0.1", 0)
    held.listen()
    port = held.getsockname()[1]
    with held:
        with pytest.raises(PortTaken, match=str(port)):
            listen_socket("127.0.0.1", port, strict=True)
        with listen_socket("127.0.0.1", port) as free:
            assert port < free.getsockname()[1] <= port + 20
