"""Files in a store, addressed as ``s3://…``, ``gs://…``, ``az://…`` or ``http://…`` and read in place by range
requests. fsspec and the store's own package come with the extra ``fleet``, and are imported on use."""

from __future__ import annotations

import errno
import io
import logging
import os
import re
import time
from collections.abc import Callable
from typing import Any, BinaryIO, TypeVar
from urllib.parse import unquote

from pipeline.common.errors import BadInput, first_line
from pipeline.common.files.user_files import FOLDERS_VARIABLE, Overloaded

ADDRESSES_VARIABLE = "CIPV_ADDRESSES"
"""Stores, or folders in them, that may be opened if ``CIPV_FOLDERS`` is set: addresses separated by spaces."""
BLOCK_BYTES = 256 << 10
"""Minimum read size of one request, since record headers lie close together."""
_OF_TESTS = "memory"
_STORES = frozenset({"s3", "gs", "gcs", "az", "abfs", "abfss", "adl", "http", "https", _OF_TESTS})
_PREFETCHING = "PrefetchProducer"
"""In asyncio's complaint about what gcsfs reads ahead of a file that its reader, DuckDB, drops without closing."""
_TRIES = 6
_FIRST_PAUSE_S = 0.1
_T = TypeVar("_T")


class NotReachable(BadInput):
    """An address that cannot be used: nothing exists there, access is denied, or the package for its store is
    missing."""


class NotThere(NotReachable):
    """Nothing exists at an address, which its store answered."""


def is_remote(address: str) -> bool:
    """Whether this is the address of a store instead of a local file."""
    scheme, separator, _ = address.partition("://")
    return bool(separator) and scheme.isalnum() and len(scheme) > 1 and scheme != "file"


def file_system(address: str) -> tuple[Any, str]:
    """fsspec's file system for a store address or a local path, and the path in it. NotReachable if it is neither, if
    the package for it is missing, or if the address is not valid for its store.

    fsspec supports many more protocols, such as archives, caches and devices, chained with ``::``. They are refused
    because they would bypass the rules of ``user_files``.
    """
    scheme = address.partition("://")[0].lower()
    if "::" in address or (is_remote(address) and scheme not in _STORES):
        known = ", ".join(sorted(_STORES - {_OF_TESTS}))
        raise NotReachable(f"{address}: not the address of a store; use one of {known}")
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise NotReachable(
            f"{address}: stores need fsspec; `make install` installs it with the extra `fleet`"
        ) from None
    logging.getLogger("asyncio").addFilter(_is_of_use)
    try:
        system, path = url_to_fs(address)
    except Exception as error:  # each store's package has its own errors, without a common base class
        raise NotReachable(f"{address}: {first_line(error)}") from None
    return system, path


def _is_of_use(message: logging.LogRecord) -> bool:
    return _PREFETCHING not in message.getMessage()


def patiently(work: Callable[[], _T], what: str) -> _T:
    """Result of a request to a store, retried a few times if it fails. NotThere if nothing exists there, NotReachable
    if access is denied, Overloaded if all retries fail."""
    pause_s = _FIRST_PAUSE_S
    for left in reversed(range(_TRIES)):
        try:
            return work()
        except NotReachable:  # already says so, as where the package for a store is missing
            raise
        except PermissionError as error:
            raise NotReachable(f"{what}: access denied: {first_line(error)}") from None
        except Exception as error:  # each store's package has its own errors, without a common base class
            if isinstance(error, FileNotFoundError) and not _may_pass(error.__cause__):
                raise NotThere(f"{what}: not found") from None
            if not left:
                failure = error.__cause__ if isinstance(error, FileNotFoundError) else error
                raise Overloaded(f"{what}: store error: {first_line(failure or error)}") from error
            time.sleep(pause_s)
            pause_s *= 2
    raise AssertionError("unreachable")


def _may_pass(cause: BaseException | None) -> bool:
    """Whether a file that "was not found" may be there later: fsspec says so of every file of a web server that does
    not answer, or answers with an error of its own (5xx) or "too many requests" (429)."""
    if type(cause).__module__.partition(".")[0] != "aiohttp":  # its errors are those of web servers
        return isinstance(cause, TimeoutError)
    status: int | None = getattr(cause, "status", None)
    return status is None or status == 429 or status >= 500


def facts(address: str) -> dict[str, Any]:
    """File metadata from a store: at least its ``size`` in bytes. Raises the same errors as ``patiently``."""
    system, path = file_system(address)
    found = patiently(lambda: system.info(path), address)
    return dict(found)


def version_of(facts: dict[str, Any]) -> str:
    """A value that changes when a file in a store is replaced: its ETag, else its modification time; combined with its
    size."""
    tag = facts.get("ETag") or facts.get("etag") or facts.get("LastModified") or facts.get("mtime") or ""
    return f"{facts.get('size')} {tag}"


def open_remote(address: str) -> BinaryIO:
    """A file in a store, open for reading. Raises the same errors as ``patiently``, and OSError if the address is not
    allowed."""
    check_allowed_address(address)
    system, path = file_system(address)
    size = patiently(lambda: system.info(path), address).get("size")
    if not size:
        raise NotReachable(f"{address}: an empty file, or the store does not report its size")
    return io.BufferedReader(_Ranges(system, path, address, int(size)), BLOCK_BYTES)


def check_allowed_address(address: str) -> None:
    """OSError if ``CIPV_FOLDERS`` restricts what may be opened and the address is not in ``CIPV_ADDRESSES``."""
    if os.environ.get(FOLDERS_VARIABLE) is None:
        return
    allowed = os.environ.get(ADDRESSES_VARIABLE, "").split()
    if ".." in re.split(r"[/\\]", unquote(address)) or not any(_is_below(address, each) for each in allowed):
        raise OSError(errno.EACCES, "outside the allowed addresses", address)


def _is_below(address: str, beginning: str) -> bool:
    """Whether an address equals another or lies below it: ``s3://cars-2/a`` is not below ``s3://cars``."""
    return address == beginning or address.startswith(beginning if beginning.endswith("/") else f"{beginning}/")


class _Ranges(io.RawIOBase):
    """A remote file in which each read is one request. Its first and its last block are kept once read: an index is
    read in many small steps, from both ends."""

    def __init__(self, system: Any, path: str, address: str, size: int) -> None:
        self._system, self._path, self._address, self._size = system, path, address, size
        self._at = 0
        self._kept: dict[int, bytes] = {}

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        begin = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        self._at = max(0, begin + offset)
        return self._at

    def tell(self) -> int:
        return self._at

    def readinto(self, buffer: Any) -> int:
        end = min(self._at + len(buffer), self._size)
        if end <= self._at:
            return 0
        data = self._read(self._at, end)
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)

    def _read(self, start: int, end: int) -> bytes:
        for first in (0, max(0, self._size - BLOCK_BYTES)):
            last = min(first + BLOCK_BYTES, self._size)
            if first <= start and end <= last:
                if first not in self._kept:
                    self._kept[first] = self._requested(first, last)
                return self._kept[first][start - first : end - first]
        return self._requested(start, end)

    def _requested(self, start: int, end: int) -> bytes:
        return patiently(lambda: self._range(start, end), self._address)

    def _range(self, start: int, end: int) -> bytes:
        data = bytes(self._system.cat_file(self._path, start=start, end=end))
        if len(data) > end - start:
            raise NotReachable(f"{self._address}: its server sends whole files, not the requested part (Range)")
        if len(data) != end - start:
            raise OSError(errno.EIO, f"{len(data)} bytes instead of {end - start}")
        return data
