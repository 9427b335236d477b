"""One decompressed chunk of an MCAP file. Messages are extracted only on demand: a frame's tick is a thousandth of the
data next to it."""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass
from typing import NamedTuple

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema

from pipeline.recording.errors import Damaged
from pipeline.recording.mcap.index import RECORD_HEAD

LARGEST_CHUNK_BYTES = 256 << 20
"""Uncompressed size. Recorders start a new chunk after one to a few dozen MB."""
_MOST_RECORDS = 1_000_000
"""Number of records in a chunk: 64 bytes each in a chunk of 64 MB. A quarter of a gigabyte of empty ones takes a
minute to walk through, and compresses to a few kilobytes."""
_NO_OPCODE = 0
"""Not a valid opcode by MCAP's specification. Zeros are read as records of it without content."""
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time


class MessagePlace(NamedTuple):
    """Position of a message in ``UnpackedChunk.data``."""

    channel_id: int
    """Topic of the message."""
    log_time_ns: int
    """When it was received."""
    publish_time_ns: int
    """Timestamp set by the sender."""
    start: int
    """First byte of its data."""
    end: int
    """One past its last byte."""


@dataclass(frozen=True)
class UnpackedChunk:
    """messages: in the order of the file. named: the schemas and channels in the chunk; a channel's schema comes before
    it."""

    data: bytes
    """Records, uncompressed."""
    messages: tuple[MessagePlace, ...]
    """In the order of the file."""
    named: tuple[Schema | Channel, ...]
    """Schemas and channels in the chunk; a channel's schema comes before it."""


NOTHING = UnpackedChunk(b"", (), ())
"""Stands for a chunk that cannot be read."""


def unpack(content: bytes) -> UnpackedChunk:
    """content: of the chunk's record. Damaged bytes make the decompressors and the library raise arbitrary errors;
    Damaged for problems they do not detect."""
    chunk = Chunk.read(ReadDataStream(io.BytesIO(content)))
    if chunk.uncompressed_size > LARGEST_CHUNK_BYTES:
        raise Damaged("a chunk of an invalid size")
    data = _decompressed(chunk)
    length = len(data)
    messages: list[MessagePlace] = []
    named: list[Schema | Channel] = []
    offset = records = 0
    while offset < length:
        opcode, size = RECORD_HEAD.unpack_from(data, offset)
        start, offset = offset + RECORD_HEAD.size, offset + RECORD_HEAD.size + size
        records += 1
        if offset > length:
            raise Damaged("a chunk that ends within a message")
        if opcode == _NO_OPCODE or records > _MOST_RECORDS:
            raise Damaged("a chunk of invalid records, or too many")
        if opcode == Opcode.MESSAGE:
            if size < _MESSAGE_HEAD.size:
                raise Damaged("a message that ends within its header")
            channel_id, _, log_time_ns, publish_time_ns = _MESSAGE_HEAD.unpack_from(data, start)
            messages.append(MessagePlace(channel_id, log_time_ns, publish_time_ns, start + _MESSAGE_HEAD.size, offset))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            kind = Schema if opcode == Opcode.SCHEMA else Channel
            named.append(kind.read(ReadDataStream(io.BytesIO(data[start:offset]))))
    return UnpackedChunk(data, tuple(messages), tuple(named))


def _decompressed(chunk: Chunk) -> bytes:
    """The chunk's uncompressed bytes, at most as many as it declares: a few kilobytes can unpack to terabytes, and both
    formats contain a size of their own for which the decompressors would allocate memory."""
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        if zstandard.frame_content_size(chunk.data) > size:
            raise Damaged("a chunk larger than declared")
        data = zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size)
    elif chunk.compression == "lz4":
        data = LZ4FrameDecompressor().decompress(chunk.data, max_length=size)
    elif chunk.compression:
        raise Damaged(f"a chunk with unsupported compression {chunk.compression!r}")
    else:
        data = chunk.data
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise Damaged("a chunk with a wrong checksum")
    return data
