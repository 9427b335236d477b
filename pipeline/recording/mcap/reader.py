"""Reads an MCAP file by chunk: memory use grows with the number of chunks, never with their contents."""

from __future__ import annotations

import io
import threading
import weakref
from collections import OrderedDict
from collections.abc import Collection, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Metadata

from pipeline.common.errors import BadInput
from pipeline.common.files.remote_files import is_remote, open_remote
from pipeline.common.files.user_files import Overloaded, open_regular
from pipeline.common.progress import Progress, silent
from pipeline.recording import topics
from pipeline.recording.errors import Damaged
from pipeline.recording.mcap.chunk import NOTHING, UnpackedChunk, unpack
from pipeline.recording.mcap.index import RECORD_HEAD, ChunkEntry, Unreadable, read_directory, record_at

_CHUNKS_HELD = 8
"""Enough for two alternating read positions, the shown frame and the background run; a frame may span three chunks."""


class NotMcap(BadInput):
    """The file is not an MCAP file, or cannot be read; the text names it."""


class Stored(NamedTuple):
    """A message as stored in the file."""

    channel: topics.Channel
    """Topic, schema and encoding."""
    log_time_ns: int
    """When it was received."""
    publish_time_ns: int
    """Timestamp set by the sender."""
    data: bytes
    """Encoded as defined by the channel."""


class McapFile:
    """Open for reading, by several threads if necessary. NotMcap if it is not an MCAP file.

    size: bytes. directory: positions of all content. damaged: indices in ``directory.chunks`` found unreadable so far.
    walk: do not use the summary.
    """

    def __init__(self, path: Path | str, *, walk: bool = False) -> None:
        """path: of a file, or the address of a file in a store, which is read by range requests."""
        self.path = path
        self.damaged: set[int] = set()
        self._held: OrderedDict[int, Future[UnpackedChunk]] = OrderedDict()
        self._lock = threading.Lock()
        try:
            self._file = self.open_again()
        except OSError as error:
            raise NotMcap(f"{path}: {error.strerror}") from None
        try:
            self.size = self._file.seek(0, io.SEEK_END)
            self.directory = read_directory(self._file, self.size, walk=walk)
        except (OSError, Unreadable) as error:
            self._file.close()
            raise NotMcap(f"{path}: {error}") from None
        weakref.finalize(self, self._file.close)  # a ``Source`` is never closed explicitly; its file is closed with it
        spans = [(entry.start_ns, entry.end_ns) for entry in self.directory.chunks]
        self._spans = np.array(spans, dtype=np.uint64).reshape(-1, 2)
        self._meet_channels()

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._file.close()

    def open_again(self) -> BinaryIO:
        """The file opened a second time. Raises the same errors as opening it."""
        path = self.path
        return open_remote(path) if isinstance(path, str) and is_remote(path) else open_regular(Path(path))

    def messages(
        self,
        wanted: Collection[str] | None = None,
        first_ns: int = 0,
        last_ns: int = 2**64 - 1,
        progress: Progress = silent,
    ) -> Iterator[Stored]:
        """Messages of these topics in the order of the file, with log times from ``first_ns`` to ``last_ns``, both
        included. An unreadable chunk is skipped and added to ``damaged``. progress: in chunks."""
        places = self._chunks_between(first_ns, last_ns)
        for done, place in enumerate(places):
            progress(done, len(places))
            if wanted is not None and not self._may_hold(self.directory.chunks[place], wanted):
                continue
            yield from self._stored(self._unpacked(place), wanted, first_ns, last_ns)

    def message(self, topic: str, log_time_ns: int) -> Stored:
        """The message of a topic at a log time. Damaged if there is none, or its chunk cannot be read."""
        for stored in self.messages((topic,), log_time_ns, log_time_ns):
            return stored
        raise Damaged(f"the session lacks a message of {topic}")

    def chunk(self, place: int) -> list[Stored]:
        """All messages of the chunk with this index in ``directory.chunks``; empty if it cannot be read."""
        return list(self._stored(self._unpacked(place)))

    def log_times(self) -> dict[topics.Channel, npt.NDArray[np.int64]]:
        """Sorted log times of all messages, from the message indexes; only chunks without an index are unpacked."""
        found: dict[int, list[int]] = {}
        for place, entry in enumerate(self.directory.chunks):
            pairs = self._indexed_times(entry)
            if entry.channels is None:
                pairs = ((each.channel_id, each.log_time_ns) for each in self._unpacked(place).messages)
            for number, at_ns in pairs:
                found.setdefault(number, []).append(min(at_ns, 2**63 - 1))
        channels = self.directory.channels
        return {channels[i]: np.sort(np.array(times)) for i, times in sorted(found.items()) if i in channels}

    def attachment(self, name: str) -> bytes | None:
        """The data of an attachment, None if there is none that can be read."""
        record = self._record(*self.directory.attachments.get(name, (0, 0)))
        try:
            return Attachment.read(ReadDataStream(io.BytesIO(record))).data if record else None
        except Exception:
            return None

    def metadata(self, name: str) -> dict[str, str] | None:
        """A metadata record, None if there is none that can be read."""
        record = self._record(*self.directory.metadata.get(name, (0, 0)))
        try:
            return Metadata.read(ReadDataStream(io.BytesIO(record))).metadata if record else None
        except Exception:
            return None

    def _meet_channels(self) -> None:
        """A file without a summary defines its channels only in its chunks: those that define a new one are read."""
        for place, entry in enumerate(self.directory.chunks):
            if entry.channels is None or not entry.channels <= self.directory.channels.keys():
                self._unpacked(place)

    def _may_hold(self, entry: ChunkEntry, wanted: Collection[str]) -> bool:
        known = self.directory.channels
        return entry.channels is None or any(known[i].topic in wanted for i in entry.channels if i in known)

    def _chunks_between(self, first_ns: int, last_ns: int) -> list[int]:
        first, last = (np.uint64(min(max(value, 0), 2**64 - 1)) for value in (first_ns, last_ns))
        return [int(place) for place in np.flatnonzero((self._spans[:, 0] <= last) & (self._spans[:, 1] >= first))]

    def _stored(
        self, chunk: UnpackedChunk, wanted: Collection[str] | None = None, first_ns: int = 0, last_ns: int = 2**64 - 1
    ) -> Iterator[Stored]:
        """Like ``messages``, for one chunk."""
        for channel_id, log_time_ns, publish_time_ns, start, end in chunk.messages:
            channel = self.directory.channels.get(channel_id)
            if channel is None or not first_ns <= log_time_ns <= last_ns:
                continue
            if wanted is None or channel.topic in wanted:
                yield Stored(channel, log_time_ns, publish_time_ns, chunk.data[start:end])

    def _unpacked(self, place: int) -> UnpackedChunk:
        """A chunk, ``NOTHING`` if it cannot be read. The most recent ones are cached; a thread that requests a chunk
        which another one is unpacking waits for it."""
        with self._lock:
            found, is_mine = self._held.get(place), False
            if found is None:
                found, is_mine = Future(), True
                self._held[place] = found
                if len(self._held) > _CHUNKS_HELD:
                    self._held.popitem(last=False)
            else:
                self._held.move_to_end(place)
        if is_mine:
            try:
                found.set_result(self._read_chunk(place))
            except BaseException as end:  # also on KeyboardInterrupt, so that waiting threads do not wait forever
                with self._lock:
                    self._held.pop(place, None)  # after a temporary failure of a store, read it again
                found.set_exception(end)
        return found.result()

    def _read_chunk(self, place: int) -> UnpackedChunk:
        if place in self.damaged:
            return NOTHING
        entry = self.directory.chunks[place]
        try:
            chunk = unpack(self._record(entry.offset, entry.length))
        except Overloaded:  # not a problem of the file
            raise
        except Exception:  # see ``unpack``
            self.damaged.add(place)
            return NOTHING
        with self._lock:
            for record in chunk.named:
                self.directory.know(record)
        return chunk

    def _indexed_times(self, entry: ChunkEntry) -> Iterator[tuple[int, int]]:
        """(channel id, log time) of a chunk's messages, from the message indexes that follow it."""
        with self._lock:
            self._file.seek(entry.offset + entry.length)
            data = self._file.read(min(entry.index_length, self.size))
        offset = 0
        while offset + RECORD_HEAD.size <= len(data):
            opcode, length = RECORD_HEAD.unpack_from(data, offset)
            offset += RECORD_HEAD.size
            if opcode == Opcode.MESSAGE_INDEX and length >= 6:
                number = int.from_bytes(data[offset : offset + 2], "little")
                pairs = data[offset + 6 : offset + length]
                for at_ns in np.frombuffer(pairs[: len(pairs) // 16 * 16], dtype="<u8")[::2]:
                    yield number, int(at_ns)
            offset += length

    def _record(self, offset: int, length: int) -> bytes:
        with self._lock:
            return record_at(self._file, offset, length, self.size)
