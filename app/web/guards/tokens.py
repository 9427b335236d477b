"""Identifies clients where other machines can reach the server: as a person or as the in-vehicle display.

A token is a capability: any client that has it is accepted. It arrives once, in a link, is stored in a cookie that
scripts cannot read, and is always compared in constant time.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import os
import secrets
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

from app.core.client_role import Account, Role
from app.web.guards.accounts import Accounts
from pipeline.common.errors import BadInput

_BYTES = 24
_MOST_ADDRESSES = 10_000
_ALL = "all networks"
"""Their key among those of networks, which are addresses."""
_HOST_BITS = 64
"""Of an IPv6 address: the part that a host in a network chooses by itself (RFC 4291)."""
SHORTEST = 16
"""Minimum length of a user-defined token; 16 random characters cannot be guessed over a network."""
FEWEST_DIFFERENT = 8
"""Minimum number of distinct characters: sixteen random letters have fewer once in ten million cases."""
_FEWEST_STEPS = 6
"""Minimum number of distinct steps from one character to the next: ``1234567890123456`` has two, random hexadecimal
digits have fewer than this less than once in a million cases."""
_VARIABLES: dict[Role, str] = {"person": "CIPV_TOKEN", "display": "CIPV_DISPLAY_TOKEN"}


@dataclass(frozen=True)
class Tokens:
    """One secret for each role."""

    person: str
    """May do everything."""
    display: str
    """May watch only."""
    chosen: frozenset[Role] = frozenset()
    """Roles whose tokens come from the environment, where other programs' logs do not show them: these are never
    printed."""
    accounts: Accounts | None = None
    """People with a token of their own; None for none."""

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ, accounts: Accounts | None = None) -> Tokens:
        """``CIPV_TOKEN`` and ``CIPV_DISPLAY_TOKEN``; a token that is not set is generated. BadInput for a weak one."""
        chosen: dict[Role, str] = {}
        for role, variable in _VARIABLES.items():
            token = environment.get(variable) or secrets.token_urlsafe(_BYTES)
            if len(token) < SHORTEST or not (token.isascii() and token.replace("-", "").replace("_", "").isalnum()):
                raise BadInput(f"{variable}: must have at least {SHORTEST} letters, digits, - or _")
            if len(set(token)) < FEWEST_DIFFERENT or _repeats(token) or _counts_up(token):
                raise BadInput(f"{variable}: too easy to guess; `openssl rand -hex 24` makes a good one")
            chosen[role] = token
        if chosen["person"] == chosen["display"]:
            raise BadInput("CIPV_TOKEN and CIPV_DISPLAY_TOKEN must differ")
        named = frozenset(role for role, name in _VARIABLES.items() if environment.get(name))
        return cls(**chosen, chosen=named, accounts=accounts)

    def shown(self, role: Role) -> str:
        """The token as printed: by the variable's name if it comes from one."""
        return f"${_VARIABLES[role]}" if role in self.chosen else getattr(self, role)

    def role_of(self, given: str | None) -> Role | None:
        """The role of a token; None if it is invalid. Runs in constant time."""
        digest = _digest(given or "")
        is_person = hmac.compare_digest(digest, _digest(self.person))
        is_display = hmac.compare_digest(digest, _digest(self.display))
        return "person" if is_person else "display" if is_display else None

    def client_of(self, given: str | None) -> tuple[Role, Account | None] | None:
        """The role of a token, and the account if it is personal; None if it is invalid."""
        role = self.role_of(given)
        if role is not None or self.accounts is None:
            return (role, None) if role is not None else None
        account = self.accounts.of_token(given)
        return ("person", account) if account is not None else None


def _repeats(token: str) -> bool:
    """Whether it consists of one repeated piece: then it occurs in its own doubling at an inner position."""
    return token in (token + token)[1:-1]


def _counts_up(token: str) -> bool:
    """Whether it follows the alphabet or the digits."""
    return len({ord(after) - ord(before) for before, after in pairwise(token)}) < _FEWEST_STEPS


class Guesses:
    """Wrong tokens by network, since everybody may choose among the 2^64 IPv6 addresses of a network. A client that
    tries more than ``allowed`` different ones in ``per_s`` must wait for each response, and everyone with a wrong one
    if all networks together tried more than ``allowed_to_all``: a proxy may believe its client's word for an address.
    That takes twenty networks at their limit; at that rate, no token is guessed. A correct token is never delayed, so
    that nobody can lock others out."""

    def __init__(
        self,
        allowed: int = 10,
        per_s: float = 60.0,
        clock: Callable[[], float] = time.monotonic,
        allowed_to_all: int = 200,
    ) -> None:
        self._allowed, self._per_s, self._clock = allowed, per_s, clock
        self._allowed_to_all = allowed_to_all
        self._wrong: dict[str, dict[bytes, float]] = {}

    def wrong(self, address: str, token: str) -> bool:
        """Count an attempt; returns whether it exceeds a limit. Repeating the same token, as by a page with an old
        cookie, does not count."""
        return self._count(_ALL, self._allowed_to_all, token) or self._count(network_of(address), self._allowed, token)

    def _count(self, whose: str, allowed: int, token: str) -> bool:
        if len(self._wrong) >= _MOST_ADDRESSES:
            self._wrong.clear()  # so many at once come from one attacker who controls all addresses
        now_s = self._clock()
        recent = {each: at_s for each, at_s in self._wrong.get(whose, {}).items() if at_s > now_s - self._per_s}
        if len(recent) <= allowed:
            recent.setdefault(_digest(token), now_s)
        self._wrong[whose] = recent
        return len(recent) > allowed


def network_of(address: str) -> str:
    """An IPv4 address, or the /64 network of an IPv6 address; anything else unchanged."""
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:
        return address
    if parsed.version == 4 or parsed.ipv4_mapped is not None:
        return str(parsed if parsed.version == 4 else parsed.ipv4_mapped)
    return str(ipaddress.ip_network((int(parsed) >> _HOST_BITS << _HOST_BITS, 128 - _HOST_BITS)))


def _digest(token: str) -> bytes:
    """A digest of fixed length, so that a comparison does not reveal the token's length."""
    return hashlib.sha256(token.encode("utf-8", "surrogateescape")).digest()
