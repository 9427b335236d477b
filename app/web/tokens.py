"""Who somebody is, where the server can be reached from other machines: a person, or the display in the car.

A token is a capability: whoever has it is let in. It comes by link once, stays in a cookie that scripts cannot read,
and is only ever compared in constant time.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
from collections.abc import Mapping
from dataclasses import dataclass

from app.core.client_role import Role
from pipeline.common.errors import BadInput

_BYTES = 24
SHORTEST = 16
"""Characters of a token that somebody chose; 16 of them from a random source cannot be guessed over a network."""
_VARIABLES: dict[Role, str] = {"person": "CIPV_TOKEN", "display": "CIPV_DISPLAY_TOKEN"}


@dataclass(frozen=True)
class Tokens:
    """One secret a role."""

    person: str
    display: str

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> Tokens:
        """``CIPV_TOKEN`` and ``CIPV_DISPLAY_TOKEN``; what is not set is made up anew. BadInput for a weak one."""
        chosen: dict[Role, str] = {}
        for role, variable in _VARIABLES.items():
            token = environment.get(variable) or secrets.token_urlsafe(_BYTES)
            if len(token) < SHORTEST or not (token.isascii() and token.replace("-", "").replace("_", "").isalnum()):
                raise BadInput(f"{variable}: must have at least {SHORTEST} letters, digits, - or _")
            chosen[role] = token
        if chosen["person"] == chosen["display"]:
            raise BadInput("CIPV_TOKEN and CIPV_DISPLAY_TOKEN must differ")
        return cls(**chosen)

    def role_of(self, given: str | None) -> Role | None:
        """Whose token it is; None for nobody's. Takes as long for every answer."""
        digest = _digest(given or "")
        is_person = hmac.compare_digest(digest, _digest(self.person))
        is_display = hmac.compare_digest(digest, _digest(self.display))
        return "person" if is_person else "display" if is_display else None


def _digest(token: str) -> bytes:
    """Of one length, so that a comparison does not tell the token's."""
    return hashlib.sha256(token.encode("utf-8", "surrogateescape")).digest()
