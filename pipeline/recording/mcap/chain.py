"""A file whose parts are chained by hash: after each chunk, a metadata record holds the SHA-256 of all bytes since the
previous record, and of that record's own hash.

This detects and locates changed bytes and removed or inserted parts. Anyone can build the chain of a changed file
again; nobody can sign it again without the key, where it is signed (``pipeline.common.files.signing``). The signature
of the last record is of the whole file, since each hash is over the one before. Other programs ignore these records;
they are not in the file's index.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, Literal, NamedTuple, Protocol

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import DataEnd, Metadata

from pipeline.common.files.signing import Signature, SignatureCheck, Signer, check_signature
from pipeline.common.files.user_files import open_regular
from pipeline.common.progress import Progress, silent
from pipeline.recording.mcap.chunk import unpack
from pipeline.recording.mcap.index import MAGIC, RECORD_HEAD, Directory, Unreadable, read_directory, record_at

NAME = "cipv-studio/chain"
BEGINNING = ""
"""The previous hash of the first link."""
PIECE_BYTES = 1 << 20
"""Files are read piece by piece: they may be larger than the memory."""
_LONGEST_LINK = 1024

ChainState = Literal["not chained", "intact", "cut off", "changed"]


class Link(NamedTuple):
    """One record of the hash chain."""

    previous: str
    """The hash in the previous record."""
    sha256: str
    """SHA-256 of that text and all bytes since that record."""
    is_last: bool
    """Whether no messages follow; if no link has this, the end of the file is missing."""
    signature: Signature | None = None
    """Signature of all other fields."""

    def said(self) -> bytes:
        """The bytes to sign."""
        return f"cipv-studio session\0{self.previous}\0{self.sha256}\0{int(self.is_last)}".encode()

    def record(self) -> bytes:
        """The record's bytes in the file."""
        values = {"previous": self.previous, "sha256": self.sha256, "last": str(int(self.is_last))}
        if self.signature is not None:
            values |= {"key": self.signature.key, "signature": self.signature.value}
        builder = RecordBuilder()
        Metadata(NAME, values).write(builder)
        return builder.end()


@dataclass(frozen=True)
class Chain:
    """Result of checking the chain of a file."""

    state: ChainState
    """``cut off``: intact up to its end, but the end of the file is missing."""
    changed: tuple[str, ...] = ()
    """Where the file has been altered, in words."""
    signature: SignatureCheck = SignatureCheck()
    """Signature of the last link."""

    def is_signed_whole(self) -> bool:
        """Whether the file is unaltered and signed up to its end."""
        return self.state == "intact" and self.signature.state == "signed"


class Writes(Protocol):
    """Output for a file's bytes."""

    def write(self, data: bytes, /) -> int: ...


class ChainWriter:
    """Hashes what is written, and appends a link on request. previous: the last link's hash if a file is continued.
    signer: signs each link."""

    def __init__(self, stream: Writes, previous: str = BEGINNING, signer: Signer | None = None) -> None:
        self._stream, self._previous, self._signer = stream, previous, signer
        self._hash = hashlib.sha256(previous.encode())
        self._has_more = False

    @property
    def last_sha256(self) -> str:
        """The hash of the last link."""
        return self._previous

    def wrote(self, data: bytes) -> None:
        """Add bytes that were written."""
        self._hash.update(data)
        self._has_more = True

    def link(self, *, is_last: bool = False) -> None:
        """Write a link over everything since the previous one; nothing if there are no new bytes."""
        if not self._has_more and not is_last:
            return
        link = Link(self._previous, self._hash.hexdigest(), is_last)
        if self._signer is not None:
            link = link._replace(signature=self._signer.sign(link.said()))
        self._stream.write(link.record())
        self._previous = link.sha256
        self._hash, self._has_more = hashlib.sha256(link.sha256.encode()), False


def verify(path: Path, progress: Progress = silent, key: str | None = None) -> Chain:
    """Check the whole file. progress: in bytes. key: the public key of the expected signature. OSError if it cannot be
    read."""
    with open_regular(path) as file:
        size = file.seek(0, io.SEEK_END)
        walk = _Walk(file, size, progress)
        chain = walk.chain()
    return replace(chain, signature=walk.signature(key))


def hashes_of_links(path: Path) -> frozenset[str]:
    """The hash in each link of a file, without checking them. OSError if it cannot be read."""
    with open_regular(path) as file:
        size = file.seek(0, io.SEEK_END)
        walk, offset, found = _Walk(file, size, silent), len(MAGIC), set[str]()
        while (head := walk.head(offset)) is not None:
            link = link_at(file, offset)
            found |= {link[0].sha256} if link is not None else set()
            offset += head[1]
    return frozenset(found)


def link_at(file: BinaryIO, offset: int) -> tuple[Link, int] | None:
    """The link at an offset of a file and the length of its record; None if there is none."""
    file.seek(offset)
    head = file.read(RECORD_HEAD.size)
    if len(head) < RECORD_HEAD.size:
        return None
    opcode, length = RECORD_HEAD.unpack(head)
    content = file.read(length) if opcode == Opcode.METADATA and length <= _LONGEST_LINK else b""
    link = _link(content) if content else None
    # these bytes are not hashed, so only their canonical form is accepted
    if link is None or link.record() != head + content:
        return None
    return link, RECORD_HEAD.size + length


class _Walk:
    """Traverses the file record by record."""

    def __init__(self, file: BinaryIO, size: int, progress: Progress) -> None:
        self._file, self._size, self._progress = file, size, progress
        self._links, self._has_data_end, self._ended = 0, False, False
        self._changed: list[str] = []
        self._last: Link | None = None

    def signature(self, key: str | None) -> SignatureCheck:
        """Check of the last link's signature. If the file was altered, it does not match."""
        if self._last is None:
            return SignatureCheck()
        found = check_signature(self._last.signature, self._last.said(), key)
        return replace(found, state="does not match") if found.state == "signed" and self._changed else found

    def chain(self) -> Chain:
        end = self._follow()
        if not self._has_data_end and self._ends_whole():
            self._changed.append(f"from byte {end:,} on it is not an MCAP file")
        if not self._links and not self._names_a_link():
            return Chain("not chained")
        if self._ended:
            self._changed += self._differences_of_summary()
        if self._changed:
            return Chain("changed", tuple(self._changed))
        return Chain("intact" if self._ended else "cut off")

    def _ends_whole(self) -> bool:
        return b"".join(self._pieces(max(0, self._size - len(MAGIC)), len(MAGIC))) == MAGIC

    def _names_a_link(self) -> bool:
        """Whether the file has a chain, although no link can be reached."""
        before = b""
        for piece in self._pieces(0, self._size):
            if NAME.encode() in before + piece:
                return True
            before = piece[-len(NAME) :]
        return False

    def _follow(self) -> int:
        """Check link by link. Returns the offset at which the check cannot continue."""
        part, previous = hashlib.sha256(BEGINNING.encode()), BEGINNING
        begin = offset = 0
        offset += self._hashed(0, len(MAGIC), part)
        has_more, is_last = False, False
        while (found := self.head(offset)) is not None:
            opcode, length = found
            link = link_at(self._file, offset)
            if opcode == Opcode.DATA_END:
                self._has_data_end, self._ended = True, is_last
                if has_more:
                    self._changed.append(f"bytes {begin:,} to {offset:,} were inserted")
                if b"".join(self._pieces(offset, length)) != _DATA_END or not self._ends_whole():
                    self._changed.append(f"bytes after {offset:,} were changed")
                return offset
            if link is None:
                self._hashed(offset, length, part)
                has_more = True
            else:
                told = link[0]
                if told.previous != previous:
                    self._changed.append(f"something before byte {begin:,} was removed or inserted")
                    part = self._part(begin, offset, told.previous)
                if part.hexdigest() != told.sha256:
                    self._changed.append(f"bytes {begin:,} to {offset:,} were changed")
                self._links, previous, is_last = self._links + 1, told.sha256, told.is_last
                self._last = told
                if check_signature(told.signature, told.said(), None).state == "does not match":
                    self._changed.append(f"the signature at byte {offset:,} does not match")
                begin, has_more = offset + length, False
                part = hashlib.sha256(previous.encode())
            offset += length
            self._progress(offset, self._size)
        return offset

    def _part(self, begin: int, end: int, previous: str) -> hashlib._Hash:
        part = hashlib.sha256(previous.encode())
        self._hashed(begin, end - begin, part)
        return part

    def head(self, offset: int) -> tuple[int, int] | None:
        """Opcode and total length of a complete record."""
        self._file.seek(offset)
        head = self._file.read(RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            return None
        opcode, length = RECORD_HEAD.unpack(head)
        length += RECORD_HEAD.size
        return (opcode, length) if opcode and offset + length <= self._size else None

    def _hashed(self, offset: int, length: int, into: hashlib._Hash) -> int:
        for piece in self._pieces(offset, length):
            into.update(piece)
        return length

    def _pieces(self, offset: int, length: int) -> Iterator[bytes]:
        self._file.seek(offset)
        while length and (piece := self._file.read(min(length, PIECE_BYTES))):
            length -= len(piece)
            yield piece

    def _meet_channels(self, directory: Directory) -> frozenset[int]:
        """Channels with messages, as defined first in the chunks: a summary could redefine them."""
        mentioned = frozenset[int]()
        for entry in directory.chunks:
            mentioned |= entry.channels or frozenset()
            if not mentioned <= directory.channels.keys():
                with suppress(Exception):  # for damaged files, the library raises arbitrary errors
                    for record in unpack(record_at(self._file, entry.offset, entry.length, self._size)).named:
                        directory.know(record)
        return mentioned

    def _differences_of_summary(self) -> list[str]:
        """The index at the file's end is derived from the chained data and must agree with it."""
        try:
            by_index = read_directory(self._file, self._size)
        except Unreadable as error:
            return [str(error)]
        if by_index.problem is not None:
            return ["the index at its end is damaged"]
        by_data = read_directory(self._file, self._size, walk=True)
        by_data.metadata.pop(NAME, None)
        mentioned = self._meet_channels(by_data)
        same = [(each.offset, each.length, each.start_ns, each.end_ns) for each in by_index.chunks] == [
            (each.offset, each.length, each.start_ns, each.end_ns) for each in by_data.chunks
        ]
        same = same and (by_index.attachments, by_index.metadata) == (by_data.attachments, by_data.metadata)
        same = same and all(by_index.channels.get(each) == by_data.channels.get(each) for each in mentioned)
        return [] if same else ["the index at its end does not match the data"]


def _data_end() -> bytes:
    """The data end record as written here: without a checksum."""
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    return builder.end()


_DATA_END = _data_end()


def _link(content: bytes) -> Link | None:
    try:
        record = Metadata.read(ReadDataStream(io.BytesIO(content)))
        if record.name != NAME:
            return None
        values = record.metadata
        signature = Signature(values["key"], values["signature"]) if "signature" in values else None
        return Link(values["previous"], values["sha256"], values["last"] == "1", signature)
    except Exception:  # damaged bytes make the library raise arbitrary errors
        return None
