"""Limits how long a client may take to shake hands, to send a request and to receive the response, and how many
connections may be open.

uvicorn waits for each of them indefinitely, and each wait holds a descriptor: with a thousand of them, no file can be
opened any more.
"""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import Callable, MutableSet
from typing import Any, Protocol

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

HEADER_S = 10.0
"""Timeout for a header, which fits into one packet."""
BODY_S = 120.0
"""Timeout for a body: 64 MiB of labels over a slow wireless link."""
STALLED_S = 60.0
"""Timeout for a client that receives nothing of a response of which more than 64 KiB are due: the slowest usable link
needs a second for these."""
MOST_CONNECTIONS = 256
"""Limit of simultaneous connections, including streams; a process has four times as many file descriptors by
default."""


class _Client(Protocol):
    """A connection whose client may keep the server waiting."""

    @property
    def waits_since_s(self) -> float | None:
        """Since when, by the loop's clock; None if it does not."""

    @property
    def is_between_requests(self) -> bool:
        """Whether it waits for a client whose earlier requests were all complete and answered."""

    def drop(self) -> None:
        """Close the connection at once."""


def make_room(connections: MutableSet[_Client], newest: _Client) -> None:
    """With too many connections, close the one whose client has kept the server waiting longest: for its handshake, for
    a complete header, for the rest of a body that is already answered, or to take more of a response. Those between two
    requests come after them: a page keeps such a connection, and opens another without a word. The newest comes last,
    so that nobody can lock others out with requests that are answered."""
    if len(connections) > MOST_CONNECTIONS:
        waits = {
            each: (each is newest, each.is_between_requests, since_s)
            for each in connections
            if (since_s := getattr(each, "waits_since_s", None)) is not None
        }
        min(waits, key=waits.__getitem__).drop()


class LimitedProtocol(H11Protocol):
    """Closes the connection of a client that exceeds a timeout, or that others need more."""

    _began_s = 0.0
    """When the client started to send a header or a body, by the loop's clock."""
    _answered_s: float | None = None
    """When the last response was complete; None before."""
    _waits: asyncio.TimerHandle | None = None
    _for_body = False
    _stalled_s: float | None = None
    """Since when the client takes nothing of a response."""
    _stalls: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._wait(HEADER_S)
        make_room(self.connections, self)  # type: ignore[arg-type]

    @property
    def waits_since_s(self) -> float | None:
        """Since when the client has sent no complete header, not the rest of an answered request, or received nothing
        of a response."""
        if self._stalled_s is not None:
            return self._stalled_s
        if self._is_waiting:
            return self._began_s if self._waits is not None else self._answered_s
        return self._answered_s if self._is_answered and self.conn.their_state is h11.SEND_BODY else None

    @property
    def is_between_requests(self) -> bool:
        """Whether all that the client has sent is answered, and it took the answers."""
        return self._is_waiting and self._answered_s is not None and self._stalled_s is None

    @property
    def _is_waiting(self) -> bool:
        """Whether it is waiting for a complete header."""
        return self.conn.their_state is h11.IDLE and self._is_answered

    @property
    def _is_answered(self) -> bool:
        """Whether no response is due."""
        return self.cycle is None or self.cycle.response_complete

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        state = self.conn.their_state
        if self._is_waiting:
            self._wait(HEADER_S)
        elif state is h11.SEND_BODY:
            if not self._for_body:
                self._end_wait()
            self._wait(BODY_S)
            self._for_body = True
        else:
            self._end_wait()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        self._end_wait()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        self._end_wait()
        self._end_stall()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        self._answered_s = self.loop.time()
        super().on_response_complete()

    def pause_writing(self) -> None:
        super().pause_writing()
        self._stalled_s = self.loop.time()
        self._stalls = self.loop.call_later(STALLED_S, self.drop)

    def resume_writing(self) -> None:
        self._end_stall()
        super().resume_writing()

    def _wait(self, timeout_s: float) -> None:
        """Timeout from the first byte on; further bytes do not extend it."""
        if self._waits is None:
            self._began_s = self.loop.time()
            self._waits = self.loop.call_later(timeout_s, self.drop)

    def _end_wait(self) -> None:
        if self._waits is not None:
            self._waits.cancel()
        self._waits, self._for_body = None, False

    def _end_stall(self) -> None:
        if self._stalls is not None:
            self._stalls.cancel()
        self._stalls, self._stalled_s = None, None

    def drop(self) -> None:
        """Close the connection at once."""
        self.connections.discard(self)
        self.transport.abort()


class TlsHandshake(asyncio.Protocol):
    """A connection until its client has shaken hands. asyncio's own TLS servers tell nobody about such connections, and
    wait a minute for each."""

    def __init__(self, tls: ssl.SSLContext, then: Callable[[], LimitedProtocol]) -> None:
        """then: makes the protocol that takes over."""
        self._tls = tls
        self._then = then()
        self._connections: MutableSet[Any] = self._then.connections
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport | None = None
        self._came = bytearray()
        self._shaking: asyncio.Task[None] | None = None
        self.waits_since_s = self._loop.time()
        """Since when it waits for the client, by the loop's clock."""
        self.is_between_requests = False
        """None was made yet."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        transport.pause_reading()  # whatever comes belongs to TLS, which is set up only by the task
        self._transport = transport
        self._connections.add(self)
        self._shaking = self._loop.create_task(self._shake())
        make_room(self._connections, self)

    async def _shake(self) -> None:
        assert self._transport is not None
        try:
            inside = await self._loop.start_tls(
                self._transport, self, self._tls, server_side=True, ssl_handshake_timeout=HEADER_S
            )
        except OSError:  # of TLS too, and of timeouts: it has closed the connection
            inside = None
        self._connections.discard(self)
        if inside is None or inside.is_closing():
            return
        self._then.connection_made(inside)
        inside.set_protocol(self._then)
        if self._came:
            self._then.data_received(bytes(self._came))

    def data_received(self, data: bytes) -> None:
        """What the client sends before ``_shake`` is told that it has shaken hands."""
        self._came += data

    def connection_lost(self, exc: Exception | None) -> None:
        self._connections.discard(self)

    def shutdown(self) -> None:
        """Called by uvicorn when it ends."""
        self.drop()

    def drop(self) -> None:
        """Close the connection at once."""
        self._connections.discard(self)
        if self._transport is not None:
            self._transport.abort()
