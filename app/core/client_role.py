"""The role of a connection: set once, where access is checked, and read wherever it matters."""

from __future__ import annotations

from typing import Literal

from starlette.requests import HTTPConnection

Role = Literal["person", "display"]
"""A display may look, mark and record; it changes no parameters, seeks nothing and opens nothing."""


def set_role(connection: HTTPConnection, role: Role) -> None:
    """Remember the role of a connection for as long as it lives."""
    connection.scope.setdefault("state", {})["role"] = role


def is_display(connection: HTTPConnection) -> bool:
    """True for who came with the display's token."""
    return connection.scope.get("state", {}).get("role") == "display"
