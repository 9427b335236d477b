"""Ends a WebSocket whose token has become invalid: a connection lasts for days, and an account may be removed or given
another role meanwhile."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from starlette.types import ASGIApp, Receive, Scope, Send

CHECK_S = 1.0
_POLICY_VIOLATION = 1008
"""Close code of RFC 6455 for a client that may not be here; the page then asks for a token."""


async def serve_while_valid(
    app: ASGIApp, scope: Scope, receive: Receive, send: Send, is_valid: Callable[[], Awaitable[bool]]
) -> None:
    """Serve the WebSocket, and check ``is_valid`` once a second. When it is false, the socket is closed; for the app,
    the client has disconnected."""
    revoked = asyncio.get_running_loop().create_future()

    async def check() -> None:
        while await is_valid():
            await asyncio.sleep(CHECK_S)
        revoked.set_result(None)

    async def receiving() -> MutableMapping[str, Any]:
        message = asyncio.ensure_future(receive())
        try:
            await asyncio.wait((message, revoked), return_when=asyncio.FIRST_COMPLETED)
            if not revoked.done():
                return await message
        finally:
            message.cancel()
        await send({"type": "websocket.close", "code": _POLICY_VIOLATION})
        return {"type": "websocket.disconnect", "code": _POLICY_VIOLATION}

    checking = asyncio.ensure_future(check())
    try:
        await app(scope, receiving, send)
    finally:
        checking.cancel()
