"""Who may talk to the server, and what its pages may do.

The server listens on loopback, but every web page that a person visits can send requests there too. So the Host header
must name this machine (a rebound DNS name does not), and what changes anything, and every WebSocket, must come from a
page of the same origin. Programs send no Origin and are let through.
"""

from __future__ import annotations

from collections.abc import Iterable
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

LOOPBACK_HOSTS = ("localhost", "127.0.0.1", "::1")
_READING = frozenset({"GET", "HEAD", "OPTIONS"})

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "frame-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
_SECURITY_HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "x-frame-options": "SAMEORIGIN",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(), geolocation=()",
}


class Access:
    """The rule, for requests and WebSockets alike. ``hosts``: further names this server may be called by."""

    def __init__(self, hosts: Iterable[str] = ()) -> None:
        self._hosts = frozenset(host.lower() for host in (*LOOPBACK_HOSTS, *hosts))

    def refusal(self, headers: Headers, *, changes: bool) -> str | None:
        """Why the request is refused, in one sentence; null when it is welcome."""
        host = headers.get("host", "")
        if _host_name(host) not in self._hosts:
            return f"this server does not answer to the name {host!r}; allow it with --allow-host"
        origin = headers.get("origin")
        if changes and origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            return f"a page of {origin} may not do this"
        return None

    def allowed(self, connection: HTTPConnection) -> bool:
        """True for a request or WebSocket that may change things."""
        return self.refusal(connection.headers, changes=True) is None


class Guard:
    """ASGI middleware: refuses by ``Access``, and adds the security headers that a response does not set itself."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            return await self._app(scope, receive, send)
        is_socket = scope["type"] == "websocket"
        changes = is_socket or scope["method"] not in _READING
        refusal = self._access.refusal(Headers(scope=scope), changes=changes)
        if refusal is None:
            return await self._app(scope, receive, send if is_socket else _with_headers(send))
        if is_socket:
            return await WebSocket(scope, receive, send).close(code=1008, reason=refusal[:120])
        await JSONResponse({"detail": refusal}, status_code=403)(scope, receive, _with_headers(send))


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _SECURITY_HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return sending


def _host_name(host: str) -> str | None:
    """The name in a Host header, without port and brackets; null when it is malformed."""
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None
