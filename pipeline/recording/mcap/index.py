"""The contents of an MCAP file and their positions, without reading its data.

The list of chunks comes from the file's summary. A file without one (the recorder was killed, or the disk was full) is
scanned from its start by record headers.
"""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass, field, replace
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Header, Schema
from mcap.summary import Summary

from pipeline.common.files.user_files import Overloaded
from pipeline.recording import topics

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")
_CHUNK_TIMES = struct.Struct("<QQ")
_FOOTER = struct.Struct("<QQI")  # start of the summary, start of its offsets, checksum
SHORTEST_BYTES = 2 * len(MAGIC) + RECORD_HEAD.size + _FOOTER.size
"""No shorter file has a footer."""


class Unreadable(Exception):
    """Not an MCAP file; the text gives the reason."""


@dataclass(frozen=True)
class ChunkEntry:
    """Position and content of a chunk."""

    offset: int
    """Offset of its record in the file."""
    length: int
    """Bytes of the record, including its header."""
    start_ns: int
    """Earliest log time in it."""
    end_ns: int
    """Latest log time in it."""
    channels: frozenset[int] | None = None
    """Channel ids of its messages; None if the file does not state them reliably."""
    index_length: int = 0
    """Bytes of the message indexes that follow the chunk."""


@dataclass
class Directory:
    """The contents of a file."""

    profile: str
    """From its header."""
    chunks: list[ChunkEntry] = field(default_factory=list)
    """In the order of the file."""
    channels: dict[int, topics.Channel] = field(default_factory=dict)
    """By id."""
    schemas: dict[int, Schema] = field(default_factory=dict)
    """By id."""
    attachments: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Name → offset, length."""
    metadata: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Name → offset, length."""
    problem: str | None = None
    """What is missing; None for a complete file."""
    is_cut: bool = False
    """Whether its end is missing."""
    sound_bytes: int = 0
    """Offset up to which records are complete."""

    def know(self, record: Schema | Channel) -> None:
        """Add a channel, or a schema of later channels, from the summary or a chunk."""
        if isinstance(record, Schema):
            self.schemas[record.id] = record
            return
        schema = self.schemas.get(record.schema_id) or Schema(0, b"", "", "")
        named = tuple(sorted(record.metadata.items()))
        self.channels[record.id] = topics.Channel(
            record.topic, record.message_encoding, schema.name, schema.encoding, schema.data, named
        )


def read_directory(file: BinaryIO, size: int, *, walk: bool = False) -> Directory:
    """Read an open file of ``size`` bytes. walk: do not use the summary. Unreadable if it is not an MCAP file."""
    profile = _read_profile(file)
    found = None if walk else _from_summary(file, size, profile)
    return found or _Walk(file, size, profile).directory


def record_at(file: BinaryIO, offset: int, length: int, size: int) -> bytes:
    """The content of a record at ``offset`` with a total length of ``length``; empty outside the file."""
    if offset >= size:
        return b""
    file.seek(offset + RECORD_HEAD.size)
    return file.read(max(0, min(length, size) - RECORD_HEAD.size))


def _read_profile(file: BinaryIO) -> str:
    file.seek(0)
    start = file.read(4096)
    if not start.startswith(MAGIC):
        file.seek(0, io.SEEK_END)
        file.seek(max(0, file.tell() - len(MAGIC)))
        if file.read() == MAGIC:
            raise Unreadable("a damaged MCAP file: its beginning was overwritten")
        raise Unreadable("not an MCAP file")
    try:
        opcode, _ = RECORD_HEAD.unpack_from(start, len(MAGIC))
        header = Header.read(ReadDataStream(io.BytesIO(start[len(MAGIC) + RECORD_HEAD.size :])))
    except Exception:  # see below
        opcode = None
    if opcode != Opcode.HEADER:
        raise Unreadable("a damaged MCAP file: it has no header")
    return header.profile


def read_summary(file: BinaryIO, size: int) -> Summary | None:
    """The summary as read by the library. None if there is none that matches the file."""
    try:
        if not _is_sound(file, size):
            return None
        file.seek(0)
        summary = SeekingReader(file, record_size_limit=size).get_summary()
    except Overloaded:  # a problem of the store, not of the file
        raise
    except Exception:  # damaged bytes make the library raise arbitrary errors; such a summary is treated as missing
        return None
    if summary is None or summary.statistics is None:
        return None
    ends = [index.chunk_start_offset + index.chunk_length for index in summary.chunk_indexes]
    is_complete = len(ends) == summary.statistics.chunk_count and max(ends, default=0) <= size
    if not is_complete or (summary.statistics.message_count and not ends):
        return None
    return summary


def is_closed(file: BinaryIO, size: int) -> bool:
    """Whether a file ends like a complete one."""
    file.seek(size - len(MAGIC))
    return file.read(len(MAGIC)) == MAGIC


def summary_start(file: BinaryIO, size: int) -> int:
    """Offset of the summary of a complete file; 0 without one."""
    return int(_footer(file, size)[1][0])


def _from_summary(file: BinaryIO, size: int, profile: str) -> Directory | None:
    """None without a summary."""
    summary = read_summary(file, size)
    if summary is None:
        return None
    chunks = [
        ChunkEntry(
            index.chunk_start_offset,
            index.chunk_length,
            index.message_start_time,
            index.message_end_time,
            frozenset(index.message_index_offsets) or None,
            index.message_index_length,
        )
        for index in sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset)
    ]
    found = Directory(
        profile,
        chunks,
        schemas=dict(summary.schemas),
        attachments={index.name: (index.offset, index.length) for index in summary.attachment_indexes},
        metadata={index.name: (index.offset, index.length) for index in summary.metadata_indexes},
        sound_bytes=size,
    )
    for channel in summary.channels.values():
        found.know(channel)
    return found


def _is_sound(file: BinaryIO, size: int) -> bool:
    """Whether the summary's checksum is correct or missing: it covers the summary and the footer up to itself."""
    footer_offset, (start, _, crc) = _footer(file, size)
    if start == 0 or crc == 0:
        return True
    file.seek(start)
    return zlib.crc32(file.read(footer_offset + RECORD_HEAD.size + _FOOTER.size - 4 - start)) == crc


def _footer(file: BinaryIO, size: int) -> tuple[int, tuple[int, int, int]]:
    """Its offset and its fields."""
    offset = size - len(MAGIC) - RECORD_HEAD.size - _FOOTER.size
    start, offsets_start, crc = _FOOTER.unpack(record_at(file, offset, RECORD_HEAD.size + _FOOTER.size, size))
    return offset, (start, offsets_start, crc)


class _Walk:
    """Reads record by record to the end of the data, or to where the file is truncated."""

    def __init__(self, file: BinaryIO, size: int, profile: str) -> None:
        self._file, self._size = file, size
        self.directory = Directory(profile)
        offset, opcode = len(MAGIC), 0
        while opcode != Opcode.DATA_END and offset + RECORD_HEAD.size <= size:
            file.seek(offset)
            opcode, length = RECORD_HEAD.unpack(file.read(RECORD_HEAD.size))
            length += RECORD_HEAD.size
            if opcode == 0 or offset + length > size:
                break
            self._meet(opcode, offset, length)
            offset += length
        self._conclude(offset, opcode == Opcode.DATA_END)

    def _meet(self, opcode: int, offset: int, length: int) -> None:
        chunks = self.directory.chunks
        content_length = length - RECORD_HEAD.size
        if opcode == Opcode.CHUNK and content_length >= _CHUNK_TIMES.size:
            start_ns, end_ns = _CHUNK_TIMES.unpack(self._file.read(_CHUNK_TIMES.size))
            chunks.append(ChunkEntry(offset, length, start_ns, end_ns))
        elif opcode == Opcode.MESSAGE_INDEX and chunks and content_length >= 2:
            last, number = chunks[-1], int.from_bytes(self._file.read(2), "little")
            known = (last.channels or frozenset()) | {number}
            chunks[-1] = replace(last, channels=known, index_length=last.index_length + length)
        elif opcode in (Opcode.ATTACHMENT, Opcode.METADATA):
            content = record_at(self._file, offset, min(length, 4096), self._size)
            stream = ReadDataStream(io.BytesIO(content[16:] if opcode == Opcode.ATTACHMENT else content))
            places = self.directory.attachments if opcode == Opcode.ATTACHMENT else self.directory.metadata
            try:
                places[stream.read_prefixed_string()] = offset, length
            except Exception:  # a damaged name; it will not be requested
                return

    def _conclude(self, offset: int, has_ended: bool) -> None:
        found = self.directory
        found.sound_bytes = offset
        found.problem = "it was not closed properly and has no index"
        if not has_ended:
            found.is_cut = True
            size = f"{offset / 1e6:.1f} MB" if offset >= 1e6 else f"{offset:,} bytes"
            found.problem = f"it is cut off after {size}"
            if found.chunks:  # its message indexes may be truncated as well
                found.chunks[-1] = replace(found.chunks[-1], channels=None)
