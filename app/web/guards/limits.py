"""Size limits of requests: for a set of parameters, and for a label file where one is expected."""

from __future__ import annotations

from collections.abc import Mapping

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LARGEST_BODY = 1 << 20
LARGEST_FILE = 64 << 20
"""Bytes of a label file."""
LARGEST_MESSAGE = 1 << 20
"""Bytes of one WebSocket message from a page; the page's own messages have a few dozen."""

_GOODBYE = {"connection": "close"}
"""The rest of the body is not read, so the connection cannot be reused."""


class BodyLimit:
    """ASGI middleware: 413 as soon as a body, declared or received, exceeds ``largest`` bytes, or the limit in
    ``files`` for its path. Data beyond the limit is never held in memory."""

    def __init__(self, app: ASGIApp, largest: int = LARGEST_BODY, files: Mapping[str, int] | None = None) -> None:
        self._app = app
        self._largest = largest
        self._files = files or {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        largest = self._files.get(scope["path"], self._largest)
        said = Headers(scope=scope).get("content-length", "0")
        if not said.isdecimal() or int(said) > largest:
            return await JSONResponse({"detail": _too_large(largest)}, 413, _GOODBYE)(scope, receive, send)
        await self._app(scope, self._counted(receive, largest), send)

    def _counted(self, receive: Receive, largest: int) -> Receive:
        got = 0

        async def receiving() -> Message:
            nonlocal got
            message = await receive()
            got += len(message.get("body", b""))
            if got > largest:
                raise HTTPException(413, _too_large(largest), _GOODBYE)  # the framework passes it through unchanged
            return message

        return receiving


def _too_large(largest: int) -> str:
    return f"the request is larger than {largest >> 20} MiB"
