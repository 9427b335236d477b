"""Writing files: small ones that hold a person's work are replaced as a whole or not at all, and never overwritten when
damaged; results grow line by line."""

from __future__ import annotations

import errno
import logging
import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, TextIO

_LOG = logging.getLogger(__name__)
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What the system says of a disk, a quota or a limit that is exhausted, without naming the file."""


@contextmanager
def replacing(target: Path) -> Iterator[BinaryIO]:
    """A file to write; it replaces ``target`` when the block ends and is synced to disk.

    After an error in the block or a power failure, ``target`` is unchanged. Missing folders are created. OSError if the
    file cannot be written.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".{target.name}.{uuid.uuid4().hex}")
    try:
        with part.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def written_text(target: Path) -> Iterator[TextIO]:
    """A UTF-8 text file that grows while it is written. OSError, with the file's name, if it cannot be written."""
    try:
        with target.open("w", encoding="utf-8") as file:
            yield file
    except OSError as error:
        if error.errno in _FULL and error.filename is None:
            error.filename = str(target)
        raise


def replace_text(target: Path, text: str) -> None:
    """Write a whole text file, as ``replacing`` does, in UTF-8."""
    with replacing(target) as file:
        file.write(text.encode("utf-8"))


def set_aside(damaged: Path) -> None:
    """Rename a file that cannot be read to ``NAME.damaged``, so that the next save does not overwrite it.

    Files renamed earlier are kept as well. If a file cannot be renamed, it stays, and this is logged.
    """
    aside = damaged.with_name(f"{damaged.name}.damaged")
    if aside.exists():
        aside = aside.with_name(f"{aside.name}-{uuid.uuid4().hex[:8]}")
    try:
        damaged.rename(aside)
    except OSError as error:
        _LOG.warning("%s is damaged, and cannot be renamed: %s", damaged, error.strerror)
    else:
        _LOG.warning("%s is damaged and was renamed as %s", damaged, aside.name)
