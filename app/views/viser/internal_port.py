"""Restricts viser's loopback port to this program's own proxy.

viser supports neither tokens nor origin checks, and every program and web page on this machine can reach loopback. Each
request and each WebSocket must therefore carry a secret of this process in a header, which the proxy adds and a page
cannot set. viser offers no hook for this check, but the ``serve`` function of the websockets library that it calls gets
one during startup. Programs that connect and do not shake hands would fill this process's file descriptors, so only
the newest few of these stay connected.
"""

from __future__ import annotations

import asyncio
import hmac
import http
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response
from websockets.protocol import State

_NAME = "x-cipv-internal"
HEADERS = {_NAME: secrets.token_urlsafe(32)}
"""Headers that the proxy sends with every request."""
PAGE_HEADER = "x-cipv-page"
"""Header with which the proxy identifies the page that contains the 3D view."""
PAGE: ContextVar[str] = ContextVar("page", default="")
"""That page's name, in everything that viser runs on its event loop for this browser; empty if unknown."""
MOST_NEWCOMERS = 16
"""Limit of connections that have not yet shaken hands; the proxy needs a few milliseconds for that."""
_starting = threading.Lock()
Respond = Callable[[ServerConnection, Request], Response | None]


@contextmanager
def demanding_the_secret() -> Iterator[None]:
    """A viser server started in the block requires the secret for all connections. RuntimeError if no server was
    started in the expected way."""
    with _starting:
        usual, guarded = websockets.asyncio.server.serve, False

        def serve(handler: Any, *arguments: Any, process_request: Respond, **options: Any) -> Any:
            nonlocal guarded
            guarded = True
            options |= {"process_request": _checked(process_request), "create_connection": _limited()}
            return usual(handler, *arguments, **options)

        websockets.asyncio.server.serve = serve  # type: ignore[assignment, misc]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = usual  # type: ignore[misc]
    if not guarded:
        raise RuntimeError("viser's server was started without the check of its internal secret")


def _limited() -> type[ServerConnection]:
    """The class of one server's connections, which keeps their number small until they have shaken hands."""
    newcomers: list[ServerConnection] = []

    class Limited(ServerConnection):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            super().connection_made(transport)
            newcomers[:] = [each for each in newcomers if each.state is State.CONNECTING] + [self]
            if len(newcomers) > MOST_NEWCOMERS:
                newcomers.pop(0).transport.abort()

        def connection_lost(self, exc: Exception | None) -> None:
            super().connection_lost(exc)
            if self in newcomers:
                newcomers.remove(self)

    return Limited


def _checked(answer: Respond) -> Respond:
    def process_request(connection: ServerConnection, request: Request) -> Response | None:
        given = request.headers.get_all(_NAME)
        if len(given) != 1 or not hmac.compare_digest(given[0].encode(), HEADERS[_NAME].encode()):
            return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", Headers({"Content-Length": "0"}), b"")
        PAGE.set(request.headers.get(PAGE_HEADER, ""))
        return answer(connection, request)

    return process_request
