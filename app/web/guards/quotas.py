"""Limits how many requests a role may have at a time, and cancels work when nobody waits for it any more.

Forty threads answer all requests. Without a limit, a display with view access only could occupy all of them with long
requests, so displays together may have a few threads and people the rest. Health checks and the stream of frames do not
count.
"""

from __future__ import annotations

import asyncio
import threading
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from typing import TypeVar

from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from app.core.client_role import Role, is_display
from app.core.jobs import Cancelled
from pipeline.common.progress import Progress

AT_ONCE: Mapping[Role, int] = {"person": 30, "display": 6}
"""Maximum concurrent requests of a role, over all its clients. Browsers send six at a time; together the roles leave
some threads free."""
STREAMS: Mapping[Role, int] = {"person": 48, "display": 16}
"""Maximum open WebSockets of a role."""
_WORK = ("/api/", "/metrics", "/openapi.json")
"""Prefixes of requests that are computed."""
_LOOK_S = 0.25
T = TypeVar("T")


class RoleQuota:
    """ASGI middleware: 429 for a request, 403 for a WebSocket, that exceeds its role's quota."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._under_way: Counter[tuple[str, Role]] = Counter()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            return await self._app(scope, receive, send)
        role: Role = "display" if is_display(HTTPConnection(scope)) else "person"
        kind, limits = (scope["type"], AT_ONCE if scope["type"] == "http" else STREAMS)
        if kind == "http" and not scope["path"].startswith(_WORK):
            # a page's files are exempt: browsers request many at once, and the page does not work without them
            return await self._app(scope, receive, send)
        if self._under_way[kind, role] >= limits[role]:
            if kind == "websocket":
                await receive()
                return await send({"type": "websocket.close", "code": 1013})
            return await _TOO_MANY(scope, receive, send)
        self._under_way[kind, role] += 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._under_way[kind, role] -= 1


_TOO_MANY = JSONResponse({"detail": "too many requests at once"}, 429, {"retry-after": "1"})


async def while_waited_for(request: Request, threads: Executor, work: Callable[[Progress], T]) -> T:
    """The result of ``work``, executed on a thread of this pool. If the client disconnects, the work is aborted at its
    next progress report, and HTTPException 499 is raised, which no client receives."""
    gone = threading.Event()

    def progress(done: int, total: int) -> None:
        if gone.is_set():
            raise Cancelled

    working = asyncio.get_running_loop().run_in_executor(threads, work, progress)
    try:
        while not (await asyncio.wait({working}, timeout=_LOOK_S))[0]:
            if await request.is_disconnected():
                gone.set()
        return working.result()
    except Cancelled:
        raise HTTPException(499, "the client disconnected") from None
    finally:
        gone.set()
