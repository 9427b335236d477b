"""Requests that tests send to a server and its stream."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from typing import Any

from websockets.sync.client import ClientConnection

from app.engine.engine import Engine
from app.engine.snapshot import Snapshot

WAIT_S = 180.0


def reach(engine: Engine, condition: Callable[[Snapshot], bool]) -> Snapshot:
    return engine.wait_for(condition, WAIT_S)


def header_of(message: bytes) -> dict[str, Any]:
    (length,) = struct.unpack_from("<I", message)
    return json.loads(message[4 : 4 + length])


def next_frame(socket: ClientConnection) -> dict[str, Any]:
    while True:
        message = socket.recv(WAIT_S)
        if isinstance(message, bytes):
            return header_of(message)


def next_text(socket: ClientConnection, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    while True:
        message = socket.recv(WAIT_S)
        if isinstance(message, str) and wanted(json.loads(message)):
            return json.loads(message)
