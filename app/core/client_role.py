"""Who a connection belongs to: set once, where access is checked, and read wherever it matters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from starlette.requests import HTTPConnection

Role = Literal["person", "display"]
"""A display may view, mark and record; it cannot change parameters, seek or open sources."""
AccountRole = Literal["labeler", "reviewer", "admin"]
"""What a person with an account may do with labels; each role includes the ones before it."""
ACCOUNT_ROLES: tuple[AccountRole, ...] = get_args(AccountRole)


@dataclass(frozen=True)
class Account:
    """A person who signed in with a token of their own."""

    name: str
    """The person's name, as in their labels."""
    role: AccountRole
    """What they may do with labels."""


def set_client(connection: HTTPConnection, role: Role, account: Account | None = None) -> None:
    """Store who a connection belongs to, for its lifetime. account: None with a token that is not personal."""
    connection.scope.setdefault("state", {}).update(role=role, account=account)


def is_display(connection: HTTPConnection) -> bool:
    """Whether the client authenticated with the display's token."""
    return connection.scope.get("state", {}).get("role") == "display"


def account_of(connection: HTTPConnection) -> Account | None:
    """The account of the client; None without one: then its person may do everything, under any name."""
    account: Account | None = connection.scope.get("state", {}).get("account")
    return account


def includes(account: Account | None, role: AccountRole) -> bool:
    """Whether a client may do what a role may do."""
    return account is None or ACCOUNT_ROLES.index(account.role) >= ACCOUNT_ROLES.index(role)
