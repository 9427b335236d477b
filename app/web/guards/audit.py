"""Audit log: who changed, opened or exported what, and when, as one JSON object per line.

Reads are not logged, except for files that leave the server: whatever a browser saves as a file. The 3D view is
logged when it is opened, because its controls change parameters. Tokens are never logged.

A thread of its own writes to the disk, which may hang: the event loop answers health checks and sends frames.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from functools import partial
from io import BufferedWriter, FileIO, TextIOWrapper
from logging.handlers import RotatingFileHandler
from pathlib import Path
from urllib.parse import parse_qsl, urlencode

from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.core.client_role import account_of, is_display
from app.web.guards.access import READING
from pipeline.common.files.user_file_errors import reason_of

logger = logging.getLogger("cipv.audit")

_WITH_CONTROLS = "/viser"
"""Address prefix of the only WebSocket through which parameters are changed."""
_SHOWN_BYTES = 500
"""Logged bytes of a request's body: its beginning says what is opened or changed; label files are not copied."""
_LARGEST_BYTES, _KEPT = 5_000_000, 5
_MOST_WAITING = 10_000
"""Entries, of under 3 kB each, that may wait for the disk."""


class _PrivateFile(RotatingFileHandler):
    """Readable only by its owner, also after each rotation. It is open only while an entry is written, because a
    middleware is not told when its application ends."""

    def emit(self, record: logging.LogRecord) -> None:
        super().emit(record)
        if self.stream is not None:
            self.stream.close()
            self.stream = None

    def handleError(self, record: logging.LogRecord) -> None:
        """Say that entries are missing, in one line."""
        error = sys.exc_info()[1]
        if isinstance(error, Exception):
            _say_unwritable(self.baseFilename, error)

    def _open(self) -> TextIOWrapper:
        file = FileIO(self.baseFilename, "ab", opener=partial(os.open, mode=0o600))
        return TextIOWrapper(BufferedWriter(file), encoding="utf-8")


def _say_unwritable(file: str | Path, error: Exception) -> None:
    logger.error("%s: cannot be written, so changes are not logged: %s", file, reason_of(error))


class Audit:
    """ASGI middleware that writes to ``file``, readable only by its owner; older entries are in ``file.1`` …"""

    def __init__(self, app: ASGIApp, file: Path) -> None:
        self._app = app
        self._log = logging.Logger("cipv.audit")
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            _say_unwritable(file, error)
        handler = _PrivateFile(file, maxBytes=_LARGEST_BYTES, backupCount=_KEPT, delay=True)
        handler.setFormatter(logging.Formatter("%(message)s"))
        self._log.addHandler(handler)
        self._file = file
        self._thread = ThreadPoolExecutor(1, "cipv-audit")
        self._thread.submit(int)  # starts it: later, there may be no memory for it
        self._waiting = threading.BoundedSemaphore(_MOST_WAITING)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            await self._request(scope, receive, send)
        elif scope["type"] == "websocket" and scope["path"].startswith(_WITH_CONTROLS):
            await self._controls(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _request(self, scope: Scope, receive: Receive, send: Send) -> None:
        changes = scope["method"] not in READING
        body, status, is_file = bytearray(), 0, False

        async def receiving() -> Message:
            message = await receive()
            body.extend(message.get("body", b"")[: _SHOWN_BYTES - len(body)])
            return message

        async def sending(message: Message) -> None:
            nonlocal status, is_file
            if message["type"] == "http.response.start":
                status = message["status"]
                is_file = Headers(raw=message["headers"]).get("content-disposition", "").startswith("attachment")
            await send(message)

        try:
            await self._app(scope, receiving, sending)
        finally:
            if changes or is_file:
                self._write(HTTPConnection(scope), scope["method"], status, bytes(body))

    async def _controls(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def sending(message: Message) -> None:
            if message["type"] == "websocket.accept":
                self._write(HTTPConnection(scope), "WEBSOCKET", 101)
            await send(message)

        await self._app(scope, receive, sending)

    def _write(self, connection: HTTPConnection, method: str, status: int, body: bytes = b"") -> None:
        scope = connection.scope
        query = [(name, value) for name, value in parse_qsl(scope["query_string"].decode("latin-1")) if name != "token"]
        entry = {
            "time": datetime.now(UTC).isoformat(timespec="milliseconds"),
            "role": "display" if is_display(connection) else "person",
            "account": account.name if (account := account_of(connection)) is not None else None,
            "client": connection.client.host if connection.client else None,
            "method": method,
            "path": scope["path"] + (f"?{urlencode(query)}" if query else ""),
            "body": body.decode("utf-8", "replace"),
            "status": status,
        }
        if self._waiting.acquire(blocking=False):
            self._thread.submit(self._write_entry, json.dumps(entry, ensure_ascii=False))
        else:
            _say_unwritable(self._file, TimeoutError("the disk does not respond"))

    def _write_entry(self, entry: str) -> None:
        """Runs on the thread of the log."""
        self._waiting.release()
        self._log.info(entry)
