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
"""Folders, joined as in PATH. If set, user-supplied paths outside these folders are refused."""
LARGEST_TEXT_BYTES = 16 << 20
"""For settings, scenarios, calibrations and signal definitions; the largest DBC files have a few MB."""
_READING = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
_HANDLES = "/proc/self/fd"
_HAS_HANDLES = hasattr(os, "O_PATH") and os.path.isdir(_HANDLES)
"""Whether a file can be opened in two steps, the first of which has no effect: on Linux."""


class Overloaded(Exception):
    """The system cannot read at the moment, whatever the file contains: too many open files, or out of memory. Not an
    OSError, so that it is retried and not mistaken for a damaged file."""


@contextmanager
def overload_told_apart() -> Iterator[None]:
    """Raises Overloaded instead of an OSError that is not caused by the file itself."""
    try:
        yield
    except OSError as error:
        if error.errno in _TRANSIENT:
            raise Overloaded(f"{os.strerror(error.errno)}; trying again") from error
        raise


def open_regular(path: Path) -> BinaryIO:
    """A file, open for reading. OSError if it is not a regular file or is outside the allowed folders, also if its name
    comes to mean another file meanwhile."""
    check_allowed(path)
    with overload_told_apart():
        number = _open_by_handle(path) if _HAS_HANDLES else os.open(path, _READING)
    try:
        _check(os.fstat(number).st_mode, path)
        return os.fdopen(number, "rb")
    except BaseException:
        os.close(number)
        raise


def _open_by_handle(path: Path) -> int:
    """Checks what the name means before it is opened: opening a device or a pipe has effects of its own, such as a
    started watchdog or a woken writer."""
    handle = os.open(path, os.O_PATH)
    try:
        _check(os.fstat(handle).st_mode, path)
        itself = f"{_HANDLES}/{handle}"
        if not _is_inside(Path(os.readlink(itself))):
            raise _outside(path)
        return os.open(itself, _READING)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        os.close(handle)


def read_regular(path: Path, largest: int) -> bytes:
    """The whole content of such a file. OSError also if it is larger than ``largest`` bytes, of which none is read
    then: limits of tables are gigabytes."""
    with open_regular(path) as file, overload_told_apart():
        is_larger = os.fstat(file.fileno()).st_size > largest
        data = b"" if is_larger else file.read(largest + 1)
    if is_larger or len(data) > largest:  # the second: it grew, or it is one of /proc, which have no size
        raise OSError(errno.EFBIG, f"larger than {largest >> 20} MiB", str(path))
    return data


def check_regular(path: Path) -> None:
    """The same check for a library that opens files by name."""
    check_allowed(path)
    _check(path.stat().st_mode, path)


def check_allowed(path: Path) -> None:
    """OSError for a path that resolves, including symbolic links, to a place outside the folders of
    ``CIPV_FOLDERS``."""
    if os.environ.get(FOLDERS_VARIABLE) is not None and not _is_inside(path.resolve()):
        raise _outside(path)


def _is_inside(target: Path) -> bool:
    """Whether a path without symbolic links is inside an allowed folder."""
    named = os.environ.get(FOLDERS_VARIABLE)
    return named is None or any(target.is_relative_to(Path(each).resolve()) for each in named.split(os.pathsep) if each)


def _outside(path: Path) -> OSError:
    return OSError(errno.EACCES, "outside the allowed folders", str(path))


def _check(mode: int, path: Path) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
