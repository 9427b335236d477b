"""Small files that hold a person's work: replaced as a whole or not at all, never overwritten when damaged."""

from __future__ import annotations

import logging
import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

_LOG = logging.getLogger(__name__)


@contextmanager
def replacing(target: Path) -> Iterator[BinaryIO]:
    """A file to write in place of ``target``, which it replaces when the block ends, on the disk as well.

    After an error in the block, or if the power fails, ``target`` is as it was. Missing folders are created. OSError
    where the file cannot be written.
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


def replace_text(target: Path, text: str) -> None:
    """Write a whole text file, as ``replacing`` does, in UTF-8."""
    with replacing(target) as file:
        file.write(text.encode("utf-8"))


def set_aside(damaged: Path) -> None:
    """Rename a file that cannot be read as ``NAME.damaged``, so that the next save does not overwrite it.

    Files set aside before are kept, too. A file that cannot be renamed stays, which the log says.
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
