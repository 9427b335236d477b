"""Messages between the server and its processes, over two pipes: their length, four bytes, and msgpack."""

from __future__ import annotations

import struct
from typing import IO, TypeVar

import msgspec

_LENGTH = struct.Struct("<I")
M = TypeVar("M", bound=msgspec.Struct)


class PipeClosed(EOFError):
    """The other side has ended."""


def send(stream: IO[bytes], message: msgspec.Struct, rest: memoryview | bytes = b"") -> None:
    """Write a message, and bytes that follow it. OSError if the other side has ended."""
    packed = msgspec.msgpack.encode(message)
    stream.write(_LENGTH.pack(len(packed)) + packed)
    stream.write(rest)
    stream.flush()


def receive(stream: IO[bytes], kind: type[M]) -> M:
    """Wait for a message. PipeClosed if the other side has ended."""
    (length,) = _LENGTH.unpack(exactly(stream, _LENGTH.size))
    return msgspec.msgpack.decode(exactly(stream, length), type=kind)


def exactly(stream: IO[bytes], count: int) -> bytes:
    """Read this many bytes. PipeClosed if the other side ends before."""
    data = stream.read(count)
    if len(data) < count:
        raise PipeClosed
    return data
