"""Limits how long a client may take to send a request, and how many connections may be waiting.

uvicorn waits for a request's header indefinitely, and each wait holds a descriptor: with a thousand of them, no file
can be opened any more.
"""

from __future__ import annotations

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

HEADER_S = 10.0
"""For a header: it fits into one packet."""
BODY_S = 120.0
"""For a body: 64 MiB of labels over a slow wireless link."""
MOST_CONNECTIONS = 256
"""At once, streams included; the descriptors that a process has by default are four times as many."""


class LimitedProtocol(H11Protocol):
    """Closes the connection of a client that is late. Of too many, that which has waited longest without a whole header
    makes room; where there is none, the new one goes."""

    began_s = 0.0
    """When it began to wait, by the loop's clock."""
    _waits: asyncio.TimerHandle | None = None
    _for_body = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.began_s = self.loop.time()
        self._wait(HEADER_S)
        if len(self.connections) > MOST_CONNECTIONS:
            waiting = [each for each in self.connections if isinstance(each, LimitedProtocol) and each.is_waiting]
            min(waiting, key=lambda each: each.began_s).drop()

    @property
    def is_waiting(self) -> bool:
        """For a header that is not whole."""
        return self.conn.their_state is h11.IDLE and (self.cycle is None or self.cycle.response_complete)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        state = self.conn.their_state
        if self.is_waiting:
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
        super().connection_lost(exc)

    def _wait(self, timeout_s: float) -> None:
        """From the first byte on; more bytes do not give more time."""
        if self._waits is None:
            self.began_s = self.loop.time()
            self._waits = self.loop.call_later(timeout_s, self.drop)

    def _end_wait(self) -> None:
        if self._waits is not None:
            self._waits.cancel()
        self._waits, self._for_body = None, False

    def drop(self) -> None:
        """Hang up at once."""
        self.connections.discard(self)
        self.transport.abort()
