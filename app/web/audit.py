"""Audit log: who changed, opened or exported what, and when, as one JSON object per line.

Reads are not logged, except for files that leave the server. Tokens are never logged.
"""

from __future__ import annotations

import json
import logging
import os
from datetime import UTC, datetime
from logging.handlers import RotatingFileHandler
from pathlib import Path
from urllib.parse import parse_qsl, urlencode

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.core.client_role import is_display

_READING = frozenset({"GET", "HEAD", "OPTIONS"})
_FILES = ("/file", ".rrd", "/export")
"""How the addresses end of what is read and leaves the server as a file."""
_SHOWN_BYTES = 500
"""Of a request's body: what is opened and changed stands at its beginning; a file of labels is not copied."""
_LARGEST_BYTES, _KEPT = 5_000_000, 5


class Audit:
    """ASGI middleware that writes to ``file``, which only its owner may read; older entries are in ``file.1`` …"""

    def __init__(self, app: ASGIApp, file: Path) -> None:
        self._app = app
        self._log = logging.Logger("cipv.audit")
        file.parent.mkdir(parents=True, exist_ok=True)
        os.close(os.open(file, os.O_WRONLY | os.O_CREAT, 0o600))
        handler = RotatingFileHandler(file, maxBytes=_LARGEST_BYTES, backupCount=_KEPT, encoding="utf-8", delay=True)
        handler.setFormatter(logging.Formatter("%(message)s"))
        self._log.addHandler(handler)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or (scope["method"] in _READING and not scope["path"].endswith(_FILES)):
            return await self._app(scope, receive, send)
        body = bytearray()
        status = 0

        async def receiving() -> Message:
            message = await receive()
            body.extend(message.get("body", b"")[: _SHOWN_BYTES - len(body)])
            return message

        async def sending(message: Message) -> None:
            nonlocal status
            status = message.get("status", status)
            await send(message)

        try:
            await self._app(scope, receiving, sending)
        finally:
            self._write(HTTPConnection(scope), bytes(body), status)

    def _write(self, connection: HTTPConnection, body: bytes, status: int) -> None:
        scope = connection.scope
        query = [(name, value) for name, value in parse_qsl(scope["query_string"].decode("latin-1")) if name != "token"]
        entry = {
            "time": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "role": "display" if is_display(connection) else "person",
            "client": connection.client.host if connection.client else None,
            "method": scope["method"],
            "path": scope["path"] + (f"?{urlencode(query)}" if query else ""),
            "body": body.decode("utf-8", "replace"),
            "status": status,
        }
        self._log.info(json.dumps(entry, ensure_ascii=False))
