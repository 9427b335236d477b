"""How much a request may carry. Nothing is uploaded here: the largest body is a set of parameters."""

from __future__ import annotations

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LARGEST_BODY = 1 << 20
LARGEST_MESSAGE = 1 << 20
"""Bytes of one WebSocket message from a page; the page's own are some dozens."""

_TOO_LARGE = f"a request may carry {LARGEST_BODY >> 20} MiB at most"
_GOODBYE = {"connection": "close"}
"""The rest of the body is not read, so nothing can follow on this connection."""


class BodyLimit:
    """ASGI middleware: 413 as soon as a body is longer than ``largest`` bytes, said or sent. What is beyond that is
    never held in memory."""

    def __init__(self, app: ASGIApp, largest: int = LARGEST_BODY) -> None:
        self._app = app
        self._largest = largest

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        said = Headers(scope=scope).get("content-length", "0")
        if not said.isdecimal() or int(said) > self._largest:
            return await JSONResponse({"detail": _TOO_LARGE}, 413, _GOODBYE)(scope, receive, send)
        await self._app(scope, self._counted(receive), send)

    def _counted(self, receive: Receive) -> Receive:
        got = 0

        async def receiving() -> Message:
            nonlocal got
            message = await receive()
            got += len(message.get("body", b""))
            if got > self._largest:
                raise HTTPException(413, _TOO_LARGE, _GOODBYE)  # the framework hands it on as it is
            return message

        return receiving
