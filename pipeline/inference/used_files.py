"""Notices when the file of a network that was never registered has changed since it was last used.

A registered network, an official one that was pulled, and the embedded one have a SHA-256 that is checked whenever they
are opened (``model_registry.read_verified``). Of any other file, nobody knows what it should contain, and flipped bytes
in its weights still run: they only detect less. But this machine knows what the file contained when it was last used,
and a difference is reported. The first use cannot be checked at all.

The hashes are stored beside the networks. Where that folder cannot be written, nothing is remembered.
"""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from pipeline.common.files.user_files import LARGEST_TEXT_BYTES, read_regular
from pipeline.common.files.whole_files import replace_text
from pipeline.inference.known_networks import KNOWN
from pipeline.inference.model_registry import is_checked, store

_SHOWN = 12
"""Digits of a hash in a text: those that also name a network's results."""


@dataclass(frozen=True)
class _Used:
    """What a file contained when it was used."""

    sha256: str
    since: str
    """First use of this content, UTC."""
    before: str = ""
    """SHA-256 of the content before; empty for the first."""
    until: str = ""
    """First use of the content before, UTC."""


def file_notes(path: Path, sha256: str) -> tuple[str, ...]:
    """What a user should know about the content of a network's file, which has this SHA-256; it is remembered. Empty
    for a file whose content ``read_verified`` checks."""
    if is_checked(path):
        return ()
    if any(sha256 == known.sha256 for known in KNOWN):
        return ()
    rows, key = _read(), str(path.resolve())
    last = rows.get(key)
    now = _Used(sha256, datetime.now(UTC).strftime("%Y-%m-%d %H:%M"))
    if last is not None and last.sha256 == sha256:
        now = last
    elif last is not None and last.before != sha256:  # else it was restored
        now = _Used(sha256, now.since, last.sha256, last.since)
    if now != last:
        _write(rows | {key: now})
    if not now.before:
        return ()
    return (
        f"{path.name} has changed: since {now.since} its SHA-256 is {now.sha256[:_SHOWN]}…, when used on {now.until} "
        f"it was {now.before[:_SHOWN]}… (UTC). If nobody changed it on purpose, it is damaged. A network installed "
        "with `cipv models register` is checked whenever it is opened.",
    )


def _file() -> Path:
    return store() / "used.json"


def _read() -> dict[str, _Used]:
    """By path; empty if the file is missing or damaged."""
    with suppress(OSError, ValueError, TypeError, AttributeError, RecursionError):
        rows = json.loads(read_regular(_file(), LARGEST_TEXT_BYTES))
        found = {path: _Used(**row) for path, row in rows.items()}
        if all(isinstance(value, str) for each in found.values() for value in asdict(each).values()):
            return found
    return {}


def _write(rows: dict[str, _Used]) -> None:
    """Files that no longer exist are forgotten, so that the list stays short."""
    kept = {path: asdict(row) for path, row in rows.items() if Path(path).is_file()}
    with suppress(OSError):
        replace_text(_file(), json.dumps(kept, indent=1, sort_keys=True) + "\n")
