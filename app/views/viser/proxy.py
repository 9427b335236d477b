"""Serves the 3D view under ``/viser/`` on the web port: its page over HTTP and its scene over a WebSocket.

viser's own server has no origin checks or tokens, so it listens on loopback only and answers only this proxy
(``internal_port``). Its client opens ``ws://host/viser`` from a page at ``http://host/viser/`` (it drops the trailing
slash) and asks for the subprotocol ``viser-v<version>``, which its server requires: both are passed through unchanged.
A page of the dashboard opens ``/viser/of/<its name>/``, so that the 3D view shows that page's labels and selection.
"""

from __future__ import annotations

import asyncio
import http.client
import re
from collections.abc import Callable, Coroutine
from urllib.parse import urlsplit

from fastapi import APIRouter, Request, WebSocket
from fastapi.responses import PlainTextResponse, RedirectResponse, Response
from starlette.concurrency import run_in_threadpool
from starlette.requests import HTTPConnection
from starlette.websockets import WebSocketDisconnect, WebSocketState
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.frames import CloseCode
from websockets.typing import Data, Subprotocol

from app.views.viser.internal_port import HEADERS, PAGE_HEADER

PREFIX = "/viser"
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src 'self' data:; worker-src blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""Minimum permissions that viser's page needs, each verified: it is one file that unpacks its own script and style with
WebAssembly, reads its scene in a worker made from a blob, and fetches a light map and a decoder from inside itself
(data:). Without 'unsafe-eval' its sorter of Gaussian splats fails, with one message in the console; splats are not used
here."""
_OWN_HEADERS = {"content-security-policy": POLICY, "x-content-type-options": "nosniff", "cache-control": "no-cache"}
_PASSED_ON = ("content-type", "content-encoding")
_TIMEOUT_S = 5.0
_NAME = re.compile(r"[0-9a-f]{1,64}")
_GONE = "The 3D view is not running."


def viser_router(get_port: Callable[[], int | None], allowed: Callable[[HTTPConnection], bool]) -> APIRouter:
    """Routes for ``/viser/``. ``get_port``: viser's current port on loopback, None if it does not run; it may take a
    while, and is called on any thread. ``allowed``: the application's own rule; a WebSocket must also come from a page
    of the same host and port.

    HTTP: 403 if not allowed, 502 with one sentence if viser is not available. WebSocket: refused before it opens (HTTP
    403) if not allowed, closed with 1011 if viser is not available.
    """
    router = APIRouter()

    @router.get(PREFIX, include_in_schema=False)
    def to_folder(request: Request) -> Response:
        query = f"?{request.url.query}" if request.url.query else ""
        return RedirectResponse(f"{PREFIX}/{query}")

    @router.get(PREFIX + "/of/{name}/{path:path}", include_in_schema=False)
    async def page_of(name: str, path: str, request: Request) -> Response:
        return await page(path, request)

    @router.get(PREFIX + "/{path:path}", include_in_schema=False)
    async def page(path: str, request: Request) -> Response:
        if not allowed(request):
            return PlainTextResponse("not allowed", 403, headers=_OWN_HEADERS)
        port = await run_in_threadpool(get_port)
        if port is None:
            return PlainTextResponse(_GONE, 502, headers=_OWN_HEADERS)
        return await run_in_threadpool(_fetch, port, path, request.headers.get("accept-encoding", ""))

    @router.websocket(PREFIX)
    @router.websocket(PREFIX + "/")
    @router.websocket(PREFIX + "/of/{name}")
    async def scene(browser: WebSocket, name: str = "") -> None:
        if not (_same_origin(browser) and allowed(browser)):
            await browser.close(CloseCode.POLICY_VIOLATION)
            return
        await _bridge(browser, await run_in_threadpool(get_port), name)

    return router


def _same_origin(browser: WebSocket) -> bool:
    """Browsers always send the origin of the page that opens a WebSocket; other programs send none and are checked only
    by ``allowed``."""
    origin = browser.headers.get("origin")
    return origin is None or urlsplit(origin).netloc.lower() == browser.headers.get("host", "").lower()


def _fetch(port: int, path: str, accept_encoding: str) -> Response:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=_TIMEOUT_S)
    try:
        connection.request("GET", "/" + path, headers=HEADERS | {"Accept-Encoding": accept_encoding})
        answer = connection.getresponse()
        headers = {name: value for name in _PASSED_ON if (value := answer.getheader(name)) is not None}
        return Response(answer.read(), answer.status, headers={**headers, **_OWN_HEADERS})
    except (OSError, ValueError, http.client.HTTPException):
        return PlainTextResponse(_GONE, 502, headers=_OWN_HEADERS)
    finally:
        connection.close()


async def _bridge(browser: WebSocket, port: int | None, page: str) -> None:
    """Connect the browser to viser until either disconnects. Each direction waits for its receiver, so nothing queues
    up. page: the name of the page that shows it."""
    offered = [Subprotocol(name) for name in browser.scope.get("subprotocols", [])]
    try:
        if port is None:
            raise OSError(_GONE)
        viser = await connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=offered or None,
            additional_headers=HEADERS | ({PAGE_HEADER: page} if _NAME.fullmatch(page) else {}),
            compression=None,  # the scene is already compressed; deflating it again costs 4 ms a frame
            max_size=None,
            proxy=None,
            open_timeout=_TIMEOUT_S,
        )
    except (OSError, TimeoutError, InvalidHandshake):
        await browser.accept(subprotocol=offered[0] if offered else None)
        await browser.close(CloseCode.INTERNAL_ERROR, _GONE)
        return
    async with viser:
        await browser.accept(subprotocol=viser.subprotocol)
        await _until_one_ends(_to_viser(browser, viser), _to_browser(viser, browser))
        if browser.client_state is WebSocketState.CONNECTED and browser.application_state is WebSocketState.CONNECTED:
            await browser.close(_sendable(viser.close_code), viser.close_reason or "")


async def _until_one_ends(*directions: Coroutine[None, None, None]) -> None:
    tasks = [asyncio.ensure_future(each) for each in directions]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _to_viser(browser: WebSocket, viser: ClientConnection) -> None:
    try:
        while True:
            message = await browser.receive()
            if message["type"] == "websocket.disconnect":
                return
            data: Data | None = message.get("bytes") if message.get("bytes") is not None else message.get("text")
            if data is not None:
                await viser.send(data)
    except ConnectionClosed:
        return


async def _to_browser(viser: ClientConnection, browser: WebSocket) -> None:
    try:
        async for data in viser:
            if isinstance(data, str):
                await browser.send_text(data)
            else:
                await browser.send_bytes(data)
    except (ConnectionClosed, WebSocketDisconnect, RuntimeError):
        return  # starlette raises RuntimeError for a send after the browser disconnected


def _sendable(code: int | None) -> int:
    """A close code that may be sent; the codes for "none given" and "connection lost" may not."""
    return CloseCode.GOING_AWAY if code in (None, CloseCode.NO_STATUS_RCVD, CloseCode.ABNORMAL_CLOSURE) else int(code)
