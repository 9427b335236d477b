"""Sends one file to a store so that it arrives whole, or not at all, and checks what arrived.

S3 and disks continue an interrupted file where it stopped; other stores begin it again.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from app.fleet.store import Store
from app.fleet.sync.pace import Pace
from app.fleet.sync.s3_parts import PartedUpload, part_bytes
from pipeline.common.errors import BadInput
from pipeline.common.files.remote_files import patiently
from pipeline.common.files.user_files import open_regular
from pipeline.common.progress import Progress, silent

BLOCK_BYTES = 1 << 20
_READ_ONLY = ("http://", "https://")
_S3 = ("s3://",)


class NotSent(Exception):
    """This file cannot be sent, for a reason of its own: it cannot be read, or arrives damaged."""


class StoreFailed(Exception):
    """The store accepts no more files, for example because its disk is full."""


class Sends(Protocol):
    """A kind of store."""

    def send(self, name: str, file: Path, pace: Pace, progress: Progress) -> str:
        """Copy a file, replacing any of that name, and return its SHA-256. progress: of bytes.

        Raises:
            NotSent: see there. StoreFailed: likewise. NotReachable: the store denies it.
            Overloaded: the store keeps failing.
        """
        ...


def sender(store: Store) -> Sends:
    """How files are sent to a store. Raises BadInput for one that cannot be written to."""
    if store.address.startswith(_READ_ONLY):
        raise BadInput(f"{store.address}: a web server cannot be written to; use a folder, s3://, gs:// or az://")
    if store.folder is not None:
        return _ToDisk(store.folder)
    return _ToS3(store) if store.address.startswith(_S3) else _ToStore(store)


class _ToDisk:
    """A folder, or anything that is mounted. What is not complete yet is hidden beside its final name."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def send(self, name: str, file: Path, pace: Pace, progress: Progress) -> str:
        target = self._folder / name
        part = target.with_name(f".{target.name}.part")
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            sha256 = self._copied(file, part, pace, progress)
            if _sha256(blocks_of(part, BLOCK_BYTES)) != sha256:
                part.unlink()
                raise NotSent(f"{target}: what was written differs from {file}")
            part.replace(target)
        except OSError as error:
            raise StoreFailed(f"{target} cannot be written: {error.strerror or error}") from None
        return sha256

    def _copied(self, file: Path, part: Path, pace: Pace, progress: Progress) -> str:
        """Append to ``part`` what it lacks; one that began otherwise is begun again. Returns the file's SHA-256."""
        digest, size, done = hashlib.sha256(), file.stat().st_size, 0
        with part.open("a+b") as written:
            written.seek(0)
            for block in blocks_of(file, BLOCK_BYTES):
                pace.sending()
                is_there = written.read(len(block)) == block
                if not is_there:
                    written.truncate(done)
                    written.write(block)
                    pace.sent(len(block))
                digest.update(block)
                done += len(block)
                progress(done, size)
            written.truncate(done)
            written.flush()
            os.fsync(written.fileno())
        return digest.hexdigest()


class _ToS3:
    """S3, and stores that speak its protocol: in parts, each of which the store checks by MD5."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def send(self, name: str, file: Path, pace: Pace, progress: Progress) -> str:
        address, size = f"{self._store.address}/{name}", file.stat().st_size
        upload = PartedUpload(self._store.system, self._store.path(name), address)
        sha256 = upload.run(blocks_of(file, part_bytes(size)), size, pace, progress)
        if sha256 is None:
            raise NotSent(f"{address}: the store reports another checksum or size than that of {file}")
        return sha256


class _ToStore:
    """Any other store: written in one go, then read back."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def send(self, name: str, file: Path, pace: Pace, progress: Progress) -> str:
        path, address = self._store.path(name), f"{self._store.address}/{name}"
        size = file.stat().st_size

        def write() -> str:
            digest, done = hashlib.sha256(), 0
            with self._store.system.open(path, "wb") as written:
                for block in blocks_of(file, BLOCK_BYTES):
                    pace.sending()
                    written.write(block)
                    digest.update(block)
                    done += len(block)
                    pace.sent(len(block))
                    progress(done, size)
            return digest.hexdigest()

        sha256 = patiently(write, address)
        if sha256_there(self._store, name, size) != sha256:
            raise NotSent(f"{address}: what was written differs from {file}")
        return sha256


def blocks_of(file: Path, count: int) -> Iterator[bytes]:
    """The content of a file in blocks of ``count`` bytes; one empty block for an empty file. Raises NotSent if it
    cannot be read."""
    try:
        with open_regular(file) as opened:
            block = opened.read(count)
            yield block
            while block := opened.read(count):
                yield block
    except OSError as error:
        raise NotSent(f"{file}: {error.strerror or error}") from None


def sha256_of(file: Path) -> str:
    """The checksum of a file here. Raises NotSent if it cannot be read."""
    return _sha256(blocks_of(file, BLOCK_BYTES))


def sha256_there(store: Store, name: str, size: int, progress: Progress = silent) -> str:
    """The checksum of a file in a store, which is read back. size: in bytes; progress: of these. Raises what
    ``patiently`` raises."""
    path = store.path(name)

    def blocks() -> Iterator[bytes]:
        done = 0
        with store.system.open(path, "rb") as there:
            while block := there.read(BLOCK_BYTES):
                yield block
                done += len(block)
                progress(done, size)

    return patiently(lambda: _sha256(blocks()), f"{store.address}/{name}")


def _sha256(blocks: Iterator[bytes]) -> str:
    digest = hashlib.sha256()
    for block in blocks:
        digest.update(block)
    return digest.hexdigest()
