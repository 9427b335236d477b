"""Limits how long a client may take to send a request, and how many connections may be waiting.

uvicorn waits for a request's header indefinitely, and each wait holds a descriptor: with a thousand of them, no file
can be opened any more.
"""

from __future__ import annotations

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

HEADER_S = 10.0
"""Timeout for a header, which fits into one packet."""
BODY_S = 120.0
"""Timeout for a body: 64 MiB of labels over a slow wireless link."""
MOST_CONNECTIONS = 256
"""Limit of simultaneous connections, including streams; a process has four times as many file descriptors by
default."""


class LimitedProtocol(H11Protocol):
    """Closes the connection of a client that exceeds a timeout. With too many connections, the one that has waited
    longest for a complete header is closed; if there is none, the new one is."""

    began_s = 0.0
    """When it started waiting, by the loop's clock."""
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
        """Whether it is waiting for a complete header."""
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
        """Timeout from the first byte on; further bytes do not extend it."""
        if self._waits is None:
            self.began_s = self.loop.time()
            self._waits = self.loop.call_later(timeout_s, self.drop)

    def _end_wait(self) -> None:
        if self._waits is not None:
            self._waits.cancel()
        self._waits, self._for_body = None, False

    def drop(self) -> None:
        """Close the connection at once."""
        self.connections.discard(self)
        self.transport.abort()
