"""Frozen versions chained by hash: each holds the SHA-256 of its content, its recording, and the version before it. The
hash of the newest is stored beside them.

A version that was changed in the database, or whose predecessor or successor was removed, is rejected when it is read.
Anyone who can write the database can build the chain again, but not sign it again: see
``pipeline.common.files.signing``. Whoever kept an older database with all its signatures can still put it back.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from sqlalchemy import ColumnElement, Connection, delete, insert, select

from app.labels.errors import ActRefused
from app.labels.store.tables import DriveRow, NewestVersionRow, VersionRow
from pipeline.common.files.signing import Signature, check_signature, configured_signer, expected_key

_SAID = ("name", "person", "t_unix_ms", "tracks", "frames")


def chained(connection: Connection, values: Mapping[str, Any]) -> dict[str, Any]:
    """A new version's row, chained to the newest one of its drive, and signed if a key is configured. Locks the drive,
    so that no two versions follow the same. BadInput if that key cannot be used."""
    drive_id = values["drive_id"]
    connection.execute(select(DriveRow.id).where(DriveRow.id == drive_id).with_for_update())
    newest = _newest(connection, drive_id)
    previous = newest.sha256 if newest is not None else ""
    sha256 = _sha256(values, previous, _recording(connection, drive_id))
    return {**values, "previous": previous, "sha256": sha256, **_signature(_signed(sha256))}


def note_newest(connection: Connection, row: Mapping[str, Any]) -> None:
    """Store that a version of ``chained`` is the newest one."""
    drive_id, sha256 = row["drive_id"], row["sha256"]
    said = _signed_newest(sha256, _recording(connection, drive_id))
    connection.execute(delete(NewestVersionRow).where(NewestVersionRow.drive_id == drive_id))
    connection.execute(insert(NewestVersionRow).values(drive_id=drive_id, sha256=sha256, **_signature(said)))


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
    if row.previous and not _exists(connection, row.drive_id, VersionRow.sha256 == row.previous):
        raise ActRefused(f"the version before {row.name!r} was changed or removed from the database")
    _check_end(connection, row, expected)


def removed(connection: Connection, drive_id: int) -> bool:
    """Whether the newest version of a drive, or all that there were, are no longer in the database."""
    newest = _newest(connection, drive_id)
    return newest is not None and not _exists(connection, drive_id, VersionRow.sha256 == newest.sha256)


def _check_end(connection: Connection, row: VersionRow | Any, expected: str | None) -> None:
    """ActRefused if a version that none follows is not the newest that was frozen."""
    if _exists(connection, row.drive_id, VersionRow.previous == row.sha256):
        return
    newest = _newest(connection, row.drive_id)
    if newest is None or removed(connection, row.drive_id):
        raise ActRefused(f"a version after {row.name!r} was changed or removed from the database")
    signature = Signature(newest.signed_by, newest.signature) if newest.signature else None
    said = _signed_newest(newest.sha256, _recording(connection, row.drive_id))
    found = check_signature(signature, said, expected)
    if found.state == "does not match" or (expected is not None and found.state == "not signed"):
        raise ActRefused(f"version {row.name!r}, as the newest: {found}; freeze another one with the key")


def _newest(connection: Connection, drive_id: int) -> NewestVersionRow | Any:
    """None if no version was frozen."""
    return connection.execute(
        select(NewestVersionRow.__table__).where(NewestVersionRow.drive_id == drive_id)
    ).one_or_none()


def _exists(connection: Connection, drive_id: int, condition: ColumnElement[bool]) -> bool:
    found = select(VersionRow.name).where(VersionRow.drive_id == drive_id, condition)
    return connection.execute(found).first() is not None


def _signature(said: bytes) -> dict[str, str]:
    """The columns of a signature; empty if no key is configured."""
    signer = configured_signer()
    signature = signer.sign(said) if signer is not None else Signature("", "")
    return {"signed_by": signature.key, "signature": signature.value}


def _signed(sha256: str) -> bytes:
    """The bytes of a version that are signed."""
    return f"cipv-studio label version\0{sha256}".encode()


def _signed_newest(sha256: str, recording: str) -> bytes:
    """The bytes that are signed to say which version is the newest."""
    return f"cipv-studio newest label version\0{recording}\0{sha256}".encode()


def _recording(connection: Connection, drive_id: int) -> str:
    """Key of the recording, which does not change when it is moved."""
    return connection.scalars(select(DriveRow.key).where(DriveRow.id == drive_id)).one()


def _sha256(values: Mapping[str, Any], previous: str, recording: str | None) -> str:
    """recording: its key; None for a version from before that was a part of it."""
    of_recording = [] if recording is None else [recording]
    said = json.dumps([previous, *(values[name] for name in _SAID), *of_recording], ensure_ascii=False)
    return hashlib.sha256(said.encode() + b"\0" + values["labels"]).hexdigest()
