"""Frozen versions chained by hash: each holds the SHA-256 of its content, its recording, and the version before it.

A version that was changed in the database, or whose predecessor was removed, is rejected when it is read. Anyone who
can write the database can build the chain again, but not sign it again: see ``pipeline.common.files.signing``.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection, select

from app.labels.errors import ActRefused
from app.labels.store.tables import DriveRow, VersionRow
from pipeline.common.files.signing import Signature, check_signature, configured_signer, expected_key

_SAID = ("name", "person", "t_unix_ms", "tracks", "frames")


def chained(connection: Connection, values: Mapping[str, Any]) -> dict[str, Any]:
    """A new version's row, chained to the previous one of its drive, and signed if a key is configured. BadInput if
    that key cannot be used."""
    rows = connection.execute(
        select(VersionRow.previous, VersionRow.sha256).where(VersionRow.drive_id == values["drive_id"])
    ).all()
    followed = {row.previous for row in rows}
    previous = max((row.sha256 for row in rows if row.sha256 not in followed), default="")
    sha256, signer = _sha256(values, previous, _recording(connection, values["drive_id"])), configured_signer()
    signature = signer.sign(_signed(sha256)) if signer is not None else Signature("", "")
    return {**values, "previous": previous, "sha256": sha256, "signed_by": signature.key, "signature": signature.value}


def check(connection: Connection, row: VersionRow | Any) -> None:
    """ActRefused if a version has been altered, or is not signed with the key in ``CIPV_PUBLIC_KEY`` if that is set.
    Otherwise, versions from before the chain existed are accepted."""
    expected = expected_key()
    signature = Signature(row.signed_by, row.signature) if row.signature else None
    found = check_signature(signature, _signed(row.sha256), expected)
    if found.state == "does not match" or (expected is not None and found.state == "not signed"):
        raise ActRefused(f"version {row.name!r}: {found}")
    if not row.sha256:
        return
    values = {name: getattr(row, name) for name in (*_SAID, "labels")}
    # versions were chained without their recording before
    recordings = _recording(connection, row.drive_id), None
    if not any(row.sha256 == _sha256(values, row.previous, recording) for recording in recordings):
        raise ActRefused(
            f"version {row.name!r} was changed in the database since it was frozen, or is of another recording"
        )
    before = select(VersionRow.name).where(VersionRow.drive_id == row.drive_id, VersionRow.sha256 == row.previous)
    if row.previous and connection.execute(before).first() is None:
        raise ActRefused(f"the version before {row.name!r} was changed or removed from the database")


def _signed(sha256: str) -> bytes:
    """The bytes of a version that are signed."""
    return f"cipv-studio label version\0{sha256}".encode()


def _recording(connection: Connection, drive_id: int) -> str:
    """Key of the recording, which does not change when it is moved."""
    return connection.scalars(select(DriveRow.key).where(DriveRow.id == drive_id)).one()


def _sha256(values: Mapping[str, Any], previous: str, recording: str | None) -> str:
    """recording: its key; None for a version from before that was a part of it."""
    of_recording = [] if recording is None else [recording]
    said = json.dumps([previous, *(values[name] for name in _SAID), *of_recording], ensure_ascii=False)
    return hashlib.sha256(said.encode() + b"\0" + values["labels"]).hexdigest()
