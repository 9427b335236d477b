"""The role of a connection: set once, where access is checked, and read wherever it matters."""

from __future__ import annotations

from typing import Literal

from starlette.requests import HTTPConnection

Role = Literal["person", "display"]
"""A display may view, mark and record; it cannot change parameters, seek or open sources."""


def set_role(connection: HTTPConnection, role: Role) -> None:
    """Store the role of a connection for its lifetime."""
    connection.scope.setdefault("state", {})["role"] = role


def is_display(connection: HTTPConnection) -> bool:
    """Whether the client authenticated with the display's token."""
    return connection.scope.get("state", {}).get("role") == "display"
