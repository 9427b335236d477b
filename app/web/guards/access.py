"""Access rules of the server, and restrictions on its pages.

The server listens on loopback, but any website that a person visits can send requests there too. The Host header must
therefore name this machine (a rebound DNS name does not), and every change and every WebSocket must come from a page of
the same origin. Browsers also report the origin of other requests (Sec-Fetch-Site): the API accepts only those from its
own pages and from typed addresses. Programs send neither header and are accepted.

These rules do not help when other machines can reach the server. Every client then needs a token, on loopback too.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from html import escape
from urllib.parse import quote, urlencode, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from app.core.client_role import Account, AccountRole, Role, includes, set_client
from app.core.server_address import LOOPBACK_HOSTS, WILDCARDS, is_address
from app.web.guards.revocation import serve_while_valid
from app.web.guards.tokens import Guesses, Tokens

READING = frozenset({"GET", "HEAD", "OPTIONS"})
"""Methods of HTTP that change nothing."""
_OWN_SITES = (None, "same-origin", "none")
"""Accepted values of Sec-Fetch-Site (W3C Fetch Metadata). ``same-site`` is excluded, because it may be another port of
this host."""
_API = "/api/"
_OPEN_TO_ALL = "/healthz"
"""Only reports that the server is alive, to any monitoring system."""
_DISPLAY_MAY = frozenset({("POST", "/api/marks"), ("POST", "/api/recording")})
"""Requests by which a display may change something."""
_DISPLAY_STREAM = "/api/stream"
_LABEL_ROLES: dict[tuple[str, str], AccountRole] = {
    ("POST", "/api/labels/import"): "reviewer",
    ("POST", "/api/labels/versions"): "reviewer",
    ("GET", "/api/labels/control"): "reviewer",
}
"""Requests that need a role; what depends on the body is in ``app.labels.permissions``."""
_COOKIE_DAYS = 400
"""The longest lifetime that browsers permit: a display in a car has no keyboard to type a link again."""

_SCRIPTS = "script-src 'self'"
_POLICY = (
    f"default-src 'none'; {_SCRIPTS}; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
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


def page_policy(inline: str) -> str:
    """The content security policy of a page with one inline script. inline: its SHA-256, base64."""
    return _POLICY.replace(_SCRIPTS, f"{_SCRIPTS} 'sha256-{inline}'")


_GUESSER_WAITS_S = 1.0
_TOO_MANY_GUESSES = JSONResponse({"detail": "too many wrong tokens; wait a minute"}, 429, {"retry-after": "60"})


class Access:
    """Checks host names and origins, for requests and WebSockets alike.

    ``hosts``: further names of this server; a wildcard address among them means every address of this machine and its
    own name. IP addresses are always accepted: only names can be used for DNS rebinding.
    """

    def __init__(self, hosts: Iterable[str] = ()) -> None:
        names = {host.lower() for host in hosts}
        self._any_address = not names.isdisjoint(WILDCARDS)
        if self._any_address:
            own = socket.gethostname().lower()
            names |= {own, f"{own}.local"}
        self._hosts = frozenset((*LOOPBACK_HOSTS, *names)) - frozenset(WILDCARDS)

    def refusal(self, headers: Headers, *, changes: bool, path: str = _API) -> str | None:
        """Why the request for a path is refused, in one sentence; None if it is accepted."""
        host = headers.get("host", "")
        if not self._knows(_host_name(host)):
            return f"host name {host!r} is not allowed; add it with --allow-host"
        origin = headers.get("origin")
        if changes and origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            return f"request from a page of {origin} refused"
        if path.startswith(_API) and headers.get("sec-fetch-site") not in _OWN_SITES:
            return "cross-origin request refused"
        return None

    def allowed(self, connection: HTTPConnection) -> bool:
        """Whether a request or WebSocket may change things."""
        return self.refusal(connection.headers, changes=True) is None

    def _knows(self, name: str | None) -> bool:
        return name in self._hosts or (self._any_address and is_address(name))


class Guard:
    """ASGI middleware: refuses requests by ``Access`` and, if there are ``tokens``, by role; adds the security headers
    that a response does not set itself. It covers everything: pages, API, streams, viser and rerun."""

    def __init__(self, app: ASGIApp, access: Access, tokens: Tokens | None = None) -> None:
        self._app = app
        self._access = access
        self._tokens = tokens
        self._guesses = Guesses()
        self._threads = ThreadPoolExecutor(1, "cipv-accounts")
        if tokens is not None and tokens.accounts is not None:
            self._threads.submit(int)  # starts it: later, there may be no memory for it

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            return await self._app(scope, receive, send)
        is_socket = scope["type"] == "websocket"
        answer = await self._refused(HTTPConnection(scope), is_socket or scope["method"] not in READING)
        if answer is None:
            if is_socket and self._tokens is not None:
                still = await self._still(HTTPConnection(scope))
                return await serve_while_valid(self._app, scope, receive, send, still)
            return await self._app(scope, receive, send if is_socket else _with_headers(send))
        if answer is _TOO_MANY_GUESSES:
            await asyncio.sleep(_GUESSER_WAITS_S)
        if is_socket:
            return await WebSocket(scope, receive, send).close(code=1008)
        await answer(scope, receive, _with_headers(send))

    async def _still(self, connection: HTTPConnection) -> Callable[[], Awaitable[bool]]:
        """Whether a client is still the one as which it was accepted."""
        given = _given(connection)
        before = await self._client_of(given)

        async def is_same() -> bool:
            return await self._client_of(given) == before

        return is_same

    async def _client_of(self, given: str | None) -> tuple[Role, Account | None] | None:
        """The client with this token. Accounts are looked up on a thread of their own, because their file may be on a
        disk that hangs: the event loop answers health checks and sends frames."""
        if self._tokens is None or given is None:
            return None
        role = self._tokens.role_of(given)
        if role is not None or self._tokens.accounts is None:
            return (role, None) if role is not None else None
        return await asyncio.get_running_loop().run_in_executor(self._threads, self._tokens.client_of, given)

    async def _refused(self, connection: HTTPConnection, changes: bool) -> Response | None:
        """The response to a refused request; None if it is accepted."""
        refusal = self._access.refusal(connection.headers, changes=changes, path=connection.scope["path"])
        if refusal is not None:
            return JSONResponse({"detail": refusal}, 403)
        if self._tokens is None or (connection.scope["path"] == _OPEN_TO_ALL and not changes):
            return None
        by_link = connection.query_params.get("token") if not changes else None
        if by_link is not None and await self._client_of(by_link) is not None:
            return _signed_in(connection, by_link)
        given = _given(connection)
        client = await self._client_of(given)
        if client is None:
            wrong, address = by_link or given, connection.client.host if connection.client else ""
            is_guessing = wrong is not None and self._guesses.wrong(address, wrong)
            return _who_are_you(connection) if not is_guessing else _TOO_MANY_GUESSES
        role, account = client
        if role == "display" and not _display_may(connection.scope):
            return JSONResponse({"detail": "not allowed for the in-vehicle display"}, 403)
        needed = _LABEL_ROLES.get((connection.scope.get("method", "WEBSOCKET"), connection.scope["path"]))
        if needed is not None and not includes(account, needed):
            return JSONResponse({"detail": f"requires the role {needed}"}, 403)
        set_client(connection, role, account)
        return None


def cookie_name(connection: HTTPConnection) -> str:
    """Name of the cookie with the port in it, because cookies are not separated by port: two servers on one machine
    would overwrite each other's."""
    try:
        port = urlsplit(f"//{connection.headers.get('host', '')}").port
    except ValueError:
        port = None
    return f"cipv_token_{port or 0}"


def _display_may(scope: Scope) -> bool:
    path: str = scope["path"]
    if scope["type"] == "websocket":
        return path == _DISPLAY_STREAM
    if path == "/viser" or path.startswith("/viser/"):
        return False  # its controls change what all clients see
    if path == "/api/fleet" or path.startswith("/api/fleet/"):
        return False  # contains drives of other cars
    if (scope["method"], path) in _LABEL_ROLES:
        return False
    return scope["method"] in READING or (scope["method"], path) in _DISPLAY_MAY


def _given(connection: HTTPConnection) -> str | None:
    """The token that a client sends, as a program or in its cookie."""
    return _bearer(connection.headers) or connection.cookies.get(cookie_name(connection))


def _bearer(headers: Headers) -> str | None:
    """The bearer token sent by a program."""
    kind, _, token = headers.get("authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" else None


def _signed_in(connection: HTTPConnection, token: str) -> Response:
    """Sets the cookie and forwards to the same page without the token. It forwards by a page of this server: with a
    redirect, the browser would attribute the request to the site of the link and not send a strict cookie."""
    left = [(name, value) for name, value in connection.query_params.multi_items() if name != "token"]
    path = "/" + quote(connection.scope["path"].lstrip("/"))
    target = escape(f"{path}?{urlencode(left)}" if left else path, quote=True)
    page = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>CIPV Studio</title>'
        f'<meta http-equiv="refresh" content="0; url={target}"></head>'
        f'<body><p><a href="{target}">CIPV Studio</a></p></body></html>'
    )
    answer = HTMLResponse(page, headers={"cache-control": "no-store"})
    answer.set_cookie(
        cookie_name(connection),
        token,
        max_age=_COOKIE_DAYS * 86400,
        path="/",
        httponly=True,
        samesite="strict",
        secure=connection.url.scheme == "https",
    )
    return answer


def _who_are_you(connection: HTTPConnection) -> Response:
    sentence = "Open the link with the token that the server printed in its terminal at startup."
    headers = {"www-authenticate": "Bearer", "cache-control": "no-store"}
    if "text/html" not in connection.headers.get("accept", ""):
        return JSONResponse({"detail": sentence}, 401, headers)
    page = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>CIPV Studio</title></head>'
        f'<body><h1>CIPV Studio</h1><p>{sentence}</p><p><a href="">Try again</a></p></body></html>'
    )
    return HTMLResponse(page, 401, headers)


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _SECURITY_HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return sending


def _host_name(host: str) -> str | None:
    """The name in a Host header, without port and brackets; None if it is malformed."""
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None
