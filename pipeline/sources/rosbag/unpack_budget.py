"""Limits the decompressed size of a bag, and that of its records: ``rosbags`` has no limits, a few kilobytes can
decompress to terabytes, and a sparse file that takes no disk can contain a record of gigabytes.

The library finds its decompressors in tables of its modules; this module replaces them by bounded ones. It opens files
by the paths that it is given.
"""

from __future__ import annotations

import bz2
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from lz4.frame import LZ4FrameDecompressor
from rosbags.rosbag1 import reader as rosbag1
from rosbags.rosbag2 import reader as rosbag2
from rosbags.rosbag2 import storage_mcap

from pipeline.recording.mcap.chunk import LARGEST_CHUNK_BYTES

_LARGEST_FILE_BYTES, _LARGEST_RATIO = 1 << 30, 50
"""Limits for a bag that is compressed as one file: always permitted unpacked size, and unpacked size relative to the
file. Clouds and images compress to a third, logs to a twentieth."""

Unpack = Callable[[bytes], bytes]


class TooLarge(ValueError):
    """Data that unpacks to more than permitted."""


class CutOff(ValueError):
    """Compressed data without its end."""


class Decompressor(Protocol):
    """Interface of the decompressors of bz2, lz4 and zstd."""

    @property
    def eof(self) -> bool: ...

    def decompress(self, data: bytes, max_length: int) -> bytes: ...


def bounded(new: Callable[[], Any], largest: int = LARGEST_CHUNK_BYTES) -> Unpack:
    """Returns a function that unpacks bytes completely. TooLarge for more than ``largest``, of which no more than that
    is unpacked; CutOff for truncated data."""

    def unpack(data: bytes) -> bytes:
        decompressor: Decompressor = new()
        unpacked = decompressor.decompress(data, max_length=largest + 1)
        if len(unpacked) > largest:
            raise TooLarge(f"a chunk that unpacks to more than {largest >> 20} MB")
        if not decompressor.eof:
            raise CutOff("a chunk that is cut off")
        return unpacked

    return unpack


class BoundedPath(type(Path())):  # type: ignore[misc]
    """A path, and those below it, whose files are read within the budget."""

    def open(self, mode: str = "r", *arguments: Any, **options: Any) -> Any:
        """A file, as by ``Path.open``. In binary mode, TooLarge for more than one chunk at a time."""
        return _BoundedReader(io.FileIO(self)) if mode == "rb" else super().open(mode, *arguments, **options)


class _BoundedReader(io.BufferedReader):
    """Reads at most as much at a time as a chunk may have."""

    def read(self, size: int | None = -1, /) -> bytes:
        wanted = LARGEST_CHUNK_BYTES + 1 if size is None or size < 0 else min(size, LARGEST_CHUNK_BYTES + 1)
        return self._checked(super().read(wanted))

    def readline(self, size: int | None = -1, /) -> bytes:
        assert size is None or size < 0
        return self._checked(super().readline(LARGEST_CHUNK_BYTES + 1))

    def _checked(self, data: bytes) -> bytes:
        if len(data) > LARGEST_CHUNK_BYTES:
            raise TooLarge(f"a record of more than {LARGEST_CHUNK_BYTES >> 20} MB")
        return data


class _BoundedFile:
    """Reads an unpacked file up to its budget."""

    def __init__(self, file: Any, largest: int) -> None:
        self._file, self._left = file, largest

    def __enter__(self) -> _BoundedFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def read(self, size: int = -1) -> bytes:
        data: bytes = self._file.read(size)
        self._left -= len(data)
        if self._left < 0:
            raise TooLarge("a file that unpacks to more than the limit")
        return data


class _Zstd:
    """The part of the zstd module that the library's reader of ROS 2 bags uses."""

    def __init__(self, module: Any) -> None:
        self._module = module
        self.decompress = bounded(module.ZstdDecompressor)

    def open(self, file: Any, mode: str) -> Any:
        size = Path(file.name).stat().st_size
        return _BoundedFile(self._module.open(file, mode), max(_LARGEST_FILE_BYTES, _LARGEST_RATIO * size))


def install() -> None:
    """Replace the library's decompressors by the bounded ones. Safe to call twice."""
    library: Any = rosbag2
    if isinstance(library.zstd, _Zstd):
        return
    zstd, lz4 = bounded(library.zstd.ZstdDecompressor), bounded(LZ4FrameDecompressor)
    library.zstd = _Zstd(library.zstd)
    rosbag1.decompressors |= {"bz2": bounded(bz2.BZ2Decompressor), "lz4": lz4}
    storage_mcap.DECOMPRESSORS |= {
        "lz4": lambda data, _: lz4(data),
        "zstd": lambda data, _: zstd(data),
    }
