"""Opens files that a user named: only regular files, below a size limit, in the allowed folders.

Devices and pipes may never end, and files that are too large would fill the memory. All errors are OSErrors whose
``strerror`` is a reason in words, as for any other file that cannot be read.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

_TRANSIENT = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.ENOBUFS, errno.EAGAIN, errno.EINTR})
FOLDERS_VARIABLE = "CIPV_FOLDERS"
"""Folders, joined as in PATH. Where it is set, nothing that a user names outside them is opened."""
LARGEST_TEXT_BYTES = 16 << 20
"""Of settings, scenarios, calibrations and signal definitions; the largest DBC files have a few MB."""


class Overloaded(Exception):
    """The system cannot read at this moment, whatever is in the file: too many are open, or the memory is full. No
    OSError, so that nobody takes it for damage: it is tried again."""


@contextmanager
def overload_told_apart() -> Iterator[None]:
    """Overloaded instead of an OSError that says nothing of the file."""
    try:
        yield
    except OSError as error:
        if error.errno in _TRANSIENT:
            raise Overloaded(f"{os.strerror(error.errno)}; trying again") from error
        raise


def open_regular(path: Path) -> BinaryIO:
    """A file, open for reading. OSError for anything that is no regular file, and outside the allowed folders."""
    check_allowed(path)
    with overload_told_apart():
        number = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        _check(os.fstat(number).st_mode, path)
        return os.fdopen(number, "rb")
    except BaseException:
        os.close(number)
        raise


def read_regular(path: Path, largest: int) -> bytes:
    """The whole of such a file. OSError too when it is larger than ``largest`` bytes."""
    with open_regular(path) as file, overload_told_apart():
        data = file.read(largest + 1)
    if len(data) > largest:
        raise OSError(errno.EFBIG, f"larger than {largest >> 20} MiB", str(path))
    return data


def check_regular(path: Path) -> None:
    """The same for a library that opens a file by its name."""
    check_allowed(path)
    _check(path.stat().st_mode, path)


def check_allowed(path: Path) -> None:
    """OSError for a path outside the folders of ``CIPV_FOLDERS``, wherever its links lead."""
    named = os.environ.get(FOLDERS_VARIABLE)
    if named is None:
        return
    target = path.resolve()
    if not any(target.is_relative_to(Path(each).resolve()) for each in named.split(os.pathsep) if each):
        raise OSError(errno.EACCES, "outside the allowed folders", str(path))


def _check(mode: int, path: Path) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
