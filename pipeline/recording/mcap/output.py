"""Writes an MCAP file that is readable at any time, except for its last chunk."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from pipeline.common.files.output_files import open_new
from pipeline.common.files.signing import configured_signer
from pipeline.recording.mcap.chain import ChainWriter
from pipeline.recording.mcap.disk_time import DiskTime
from pipeline.recording.topics import PROFILE, Channel

CHUNK_BYTES = 1280 * 1024
"""A chunk is what may be lost in a crash and what a seek must unpack. A message that would exceed this size starts a
new chunk: a frame with a full sweep (0.6 MB) and its image (0.4 MB) is one chunk, and a seek reads nothing else."""
_NEVER = 2**62
"""Disables the library's own limit, which is checked after each message."""

Compression = Literal["lz4", "zstd"]
_COMPRESSION = {"lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}


class _Stream:
    """Output of ``mcap.writer``: written directly to the system and chained by hash."""

    def __init__(self, path: Path, disk: DiskTime) -> None:
        signer = configured_signer()  # if this fails, no file has been created yet
        with disk.waiting("opening a file"):
            self.file = open_new(path, buffering=0)
        self._disk = disk
        self.chain = ChainWriter(self.file, signer=signer)

    def write(self, data: bytes) -> int:
        rest = memoryview(data)
        with self._disk.waiting():
            while rest:
                rest = rest[self.file.write(rest) :]
        self.chain.wrote(data)
        return len(data)

    def tell(self) -> int:
        return self.file.tell()

    def flush(self) -> None:
        """Nothing is buffered."""

    def sync(self) -> None:
        """Wait until what was written survives a crash of the machine."""
        with self._disk.waiting("syncing the disk"):
            os.fsync(self.file.fileno())


class Output:
    """A new MCAP file. ``add`` messages, ``flush`` periodically, finally ``close``.

    Only the current chunk is buffered: when it is closed, by size or by ``flush``, its bytes have been passed to the
    system and survive a crash of this process. ``flush(to_disk=True)`` waits until they also survive a crash of the
    machine. disk: counts the time that this takes.

    If nothing more can be written, ``add``, ``flush`` and ``close`` raise OSError with the file's name, after
    truncating the file to its last complete chunk and ending it there: any reader can still open it.
    """

    def __init__(
        self,
        path: Path,
        compression: Compression = "zstd",
        profile: str = PROFILE,
        disk: DiskTime | None = None,
    ) -> None:
        self._stream = _Stream(path, disk or DiskTime())
        self.path = path
        self._channels: dict[Channel, int] = {}
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._sequences: dict[int, int] = {}
        self._sound_bytes = 0
        self._pending_bytes = 0
        self._is_open = True
        self._writer = Writer(self._stream, _NEVER, _COMPRESSION[compression])  # type: ignore[arg-type]
        with self._failing_neatly():
            self._writer.start(profile, "cipv-studio")

    @property
    def is_open(self) -> bool:
        """False after it was closed or a write failed."""
        return self._is_open

    @property
    def bytes_written(self) -> int:
        """Size of the file, without the current chunk."""
        return self._sound_bytes

    @property
    def last_sha256(self) -> str:
        """The hash of the last link."""
        return self._stream.chain.last_sha256

    @property
    def is_pending(self) -> bool:
        """Whether there is a current chunk."""
        return self._pending_bytes > 0

    def add(self, channel: Channel, log_time_ns: int, publish_time_ns: int, data: bytes) -> None:
        """Append a message. publish_time_ns: the header's time; times before 1970 become 0, the earliest time in
        MCAP."""
        if self.is_pending and self._pending_bytes + len(data) > CHUNK_BYTES:
            self.flush()
        with self._failing_neatly():
            number = self._channels.get(channel) or self._register(channel)
            self._sequences[number] += 1
            published_ns = max(publish_time_ns, 0)
            self._writer.add_message(number, log_time_ns, data, published_ns, self._sequences[number])
        self._pending_bytes += len(data)
        if self._pending_bytes >= CHUNK_BYTES:
            self.flush()

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        with self._failing_neatly():
            self._writer.add_metadata(name, values)

    def add_attachment(self, name: str, media_type: str, data: bytes, log_time_ns: int = 0) -> None:
        """Add an attachment after all messages so far; closes the current chunk first."""
        with self._failing_neatly():
            self._writer.flush()
            self._stream.chain.link()
            self._pending_bytes = 0
            self._writer.add_attachment(log_time_ns, log_time_ns, name, media_type, data)

    def flush(self, *, to_disk: bool = False) -> None:
        """Close the current chunk."""
        with self._failing_neatly():
            self._writer.flush()
            self._stream.chain.link()
            self._pending_bytes = 0
            if to_disk:
                self._stream.sync()

    def close(self) -> None:
        """Write the summary and close the file. Safe to call twice."""
        if not self._is_open:
            return
        with self._failing_neatly():
            self._writer.flush()
            self._stream.chain.link(is_last=True)
            self._writer.finish()
            self._stream.sync()
        self._is_open = False
        self._stream.file.close()

    def abandon(self) -> None:
        """End the file after its last complete chunk: what would follow is written elsewhere."""
        if self._is_open:
            self._is_open = False
            self._cut_back()

    def discard(self) -> None:
        """Close the file and remove it, because its content could not be produced."""
        self._is_open = False
        self._stream.file.close()
        self.path.unlink(missing_ok=True)

    def _register(self, channel: Channel) -> int:
        schema = channel.schema_name, channel.schema_encoding, channel.schema_data
        if schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(*schema) if channel.schema_name else 0
        number = self._writer.register_channel(
            channel.topic, channel.message_encoding, self._schemas[schema], dict(channel.metadata)
        )
        self._channels[channel], self._sequences[number] = number, 0
        return number

    @contextmanager
    def _failing_neatly(self) -> Iterator[None]:
        """Each call of the writer leaves complete records, or is undone."""
        if not self._is_open:
            raise ValueError(f"{self.path} is closed")
        try:
            yield
            self._sound_bytes = self._stream.tell()
        except OSError as error:
            self._is_open = False
            self._cut_back()
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def _cut_back(self) -> None:
        """End the file after its last complete chunk, without a summary: 50 bytes replace what did not fit."""
        end = RecordBuilder()
        DataEnd(0).write(end)
        Footer(0, 0, 0).write(end)
        with contextlib.suppress(OSError), self._stream.file as file:
            file.truncate(self._sound_bytes)
            file.seek(self._sound_bytes)
            file.write(end.end() + MCAP0_MAGIC)
