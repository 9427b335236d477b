"""The accounts of people who label: a name, a role, and the digest of a personal token.

They are kept in a file that only its owner can read. The tokens themselves are not stored: a token is printed once,
when its account is made. A running server notices changes of the file.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import secrets
from collections.abc import Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from app.core.client_role import Account, AccountRole
from app.core.session_folder import SESSIONS
from app.labels.acts.request_fields import Person
from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import first_complaint

logger = logging.getLogger("cipv.web")

FILE = SESSIONS / "accounts.json"
_BYTES = 24
_MOST = 10_000


class StoredAccount(BaseModel):
    """An account, as in the file."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    name: Person
    """Unique among the accounts."""
    role: AccountRole
    """What the person may do with labels."""
    sha256: str = Field(pattern="^[0-9a-f]{64}$")
    """Digest of the token."""


_LIST: TypeAdapter[list[StoredAccount]] = TypeAdapter(list[StoredAccount])


class Accounts:
    """The accounts in a file, read again whenever it has changed. Any thread."""

    def __init__(self, file: Path = FILE) -> None:
        """BadInput, in one sentence, if the file cannot be read."""
        self._file = file
        self._read_at = _changed_at(file)
        self._by_digest = _by_digest(read_accounts(file))

    def of_token(self, token: str | None) -> Account | None:
        """The account of a token; None if there is none. Only digests are looked up, and nobody can choose the digest
        of a guess, so that the time taken reveals nothing about the tokens."""
        self._refresh()
        return self._by_digest.get(_digest(token)) if token else None

    def _refresh(self) -> None:
        """A file that has become unreadable lets nobody in, so that an account that was removed cannot stay."""
        changed_at = _changed_at(self._file)
        if changed_at == self._read_at:
            return
        try:
            self._by_digest = _by_digest(read_accounts(self._file))
        except BadInput as error:
            logger.warning("no account can sign in: %s", error)
            self._by_digest = {}
        self._read_at = changed_at


def read_accounts(file: Path = FILE) -> list[StoredAccount]:
    """All accounts by name; none if there is no file. BadInput if it is invalid."""
    try:
        found = _LIST.validate_json(file.read_bytes())
    except FileNotFoundError:
        return []
    except OSError as error:
        raise BadInput(f"{file}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise BadInput(f"{file}: invalid list of accounts: {f'{place}: ' if place else ''}{first['msg']}") from None
    return sorted(found, key=lambda each: each.name)


def add_account(name: str, role: AccountRole, file: Path = FILE) -> str:
    """Create an account, or give an existing one another role and token; returns the token, which is not stored."""
    token = secrets.token_urlsafe(_BYTES)
    try:
        made = StoredAccount(name=name, role=role, sha256=_digest(token))
    except ValidationError as error:
        raise BadInput(first_complaint(error, StoredAccount)) from None
    others = [each for each in read_accounts(file) if each.name != made.name]
    if len(others) >= _MOST:
        raise BadInput(f"{file}: more than {_MOST:,} accounts")
    _write([*others, made], file)
    return token


def remove_account(name: str, file: Path = FILE) -> None:
    """Remove an account: its token is refused from then on, and its labels stay. BadInput if there is none."""
    found = read_accounts(file)
    left = [each for each in found if each.name != name]
    if len(left) == len(found):
        raise BadInput(f"{name}: no such account; `cipv accounts` lists them")
    _write(left, file)


def _write(accounts: Sequence[StoredAccount], file: Path) -> None:
    """In one step, so that a server never reads half of it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    beside = file.with_name(f".{file.name}.{os.getpid()}")
    text = json.dumps([each.model_dump() for each in accounts], indent=2, ensure_ascii=False)
    with open(beside, "w", encoding="utf-8", opener=lambda path, flags: os.open(path, flags, 0o600)) as out:
        out.write(text + "\n")
        out.flush()
        os.fsync(out.fileno())
    os.replace(beside, file)


def _changed_at(file: Path) -> tuple[int, int] | None:
    """Tells whether the file was replaced or written; None if there is none."""
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_ino


def _by_digest(accounts: Sequence[StoredAccount]) -> dict[str, Account]:
    return {each.sha256: Account(each.name, each.role) for each in accounts}


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode("utf-8", "surrogateescape")).hexdigest()
