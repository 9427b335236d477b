"""Messages between the server and its process for background networks, over two pipes.

Every message is its length, four bytes, and msgpack. The pixels of an image follow its message, so that they are not
copied into it.
"""

from __future__ import annotations

import struct
from typing import IO, TypeVar

import msgspec

from app.core.kept_detections import DetectionRow
from pipeline.lanes.horizon import ImageOutline

_LENGTH = struct.Struct("<I")
M = TypeVar("M", bound=msgspec.Struct)


class NetworkFile(msgspec.Struct, frozen=True):
    """A network to open."""

    name: str
    """Under which the opened network must present itself: equal names give equal detections."""
    path: str
    """Its ONNX file."""
    threads: int
    """Threads of one run."""
    input_size: tuple[int, int]
    """(height, width)."""
    outline: ImageOutline | None
    """For a lane network, of the camera's images; None for a vehicle detector."""


class Networks(msgspec.Struct):
    """The first message to the process."""

    files: tuple[NetworkFile, ...]
    """All networks that it will run."""


class ImageHeader(msgspec.Struct):
    """An image for a network. Its pixels follow the message."""

    network: int
    """Index in ``Networks.files``."""
    height: int
    """Rows."""
    width: int
    """Columns."""


class NetworkReply(msgspec.Struct):
    """The process's reply to every message."""

    row: DetectionRow | None = None
    """The detections; None once the networks are open, and after a failure."""
    error: str = ""
    """Why it failed."""


class PipeClosed(EOFError):
    """The other side has ended."""


def send(stream: IO[bytes], message: msgspec.Struct, pixels: memoryview | bytes = b"") -> None:
    """Write a message and the pixels that belong to it. OSError if the other side has ended."""
    packed = msgspec.msgpack.encode(message)
    stream.write(_LENGTH.pack(len(packed)) + packed)
    stream.write(pixels)
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
