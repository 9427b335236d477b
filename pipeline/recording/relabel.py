"""Rewrites a session with other labels. Everything before its labels is copied as bytes without decompressing a chunk,
so a drive of gigabytes takes only as long as the disk needs."""

from __future__ import annotations

import os
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Footer, McapRecord, Statistics, SummaryOffset
from mcap.summary import Summary
from mcap.writer import MCAP0_MAGIC, Writer

from pipeline.common.files.output_files import open_new
from pipeline.common.files.signing import configured_signer
from pipeline.common.progress import Progress, silent
from pipeline.recording import topics
from pipeline.recording.mcap.chain import PIECE_BYTES, ChainWriter, link_at
from pipeline.recording.mcap.index import read_summary, summary_start
from pipeline.recording.mcap.output import CHUNK_BYTES
from pipeline.recording.mcap.reader import McapFile, Stored

_CRC_BYTES = 4
_LABELS = topics.channel(topics.LABELS)


class _Chained:
    """Output of ``mcap.writer`` that continues the chain of the previous bytes."""

    def __init__(self, file: BinaryIO, previous: str) -> None:
        self.file, self.chain = file, ChainWriter(file, previous, configured_signer())

    def write(self, data: bytes) -> int:
        self.chain.wrote(data)
        return self.file.write(data)

    def tell(self) -> int:
        return self.file.tell()

    def flush(self) -> None:
        self.file.flush()


def relabel(
    file: McapFile,
    out: Path,
    labels: bytes,
    t_ns: int,
    progress: Progress = silent,
    drawn: Sequence[Stored] = (),
) -> bool:
    """Write a new file ``out`` with these labels, of header time ``t_ns``, replacing existing ones. progress: in bytes.
    drawn: labels in the form shown by viewers, at the times of its frames. False, and nothing is written, if the file's
    summary is not sufficient.

    BadInput if ``out`` exists; if this fails, no file is left behind.
    """
    with file.open_again() as source:
        summary = read_summary(source, file.size)
        place = _first_with_labels(file)
        if summary is None or place == 0 or not _is_in_order(file, summary):
            return False
        target = open_new(out, "x+b")
        try:
            with target:
                before = file.directory.chunks[place - 1]
                end = before.offset + before.length + before.index_length
                link = link_at(source, end)
                end += link[1] if link is not None else 0
                _copy(source, target, end, progress)
                stream = _Chained(target, link[0].sha256) if link is not None else target
                _write_rest(file, summary, place, end, stream, labels, t_ns, drawn)
                os.fsync(target.fileno())
        except BaseException:
            out.unlink(missing_ok=True)
            raise
    return True


def _first_with_labels(file: McapFile) -> int:
    """Index of the first chunk that may contain labels; the number of chunks if there is none."""
    numbers = {number for number, channel in file.directory.channels.items() if channel.topic in topics.OF_LABELS}
    chunks = file.directory.chunks
    return next((i for i, each in enumerate(chunks) if each.channels is None or each.channels & numbers), len(chunks))


def _is_in_order(file: McapFile, summary: Summary) -> bool:
    """Whether the summary contains every channel, and ids are assigned as by the library, so that channels keep their
    ids."""
    known = summary.channels.keys() == file.directory.channels.keys()
    return known and all(sorted(each) == [*range(1, len(each) + 1)] for each in (summary.schemas, summary.channels))


def _copy(source: BinaryIO, target: BinaryIO, end: int, progress: Progress) -> None:
    done = 0
    source.seek(0)
    while done < end:
        progress(done, end)
        piece = source.read(min(PIECE_BYTES, end - done))
        if not piece:
            raise OSError("the session shrank while being read")
        target.write(piece)
        done += len(piece)


def _write_rest(
    file: McapFile,
    before: Summary,
    place: int,
    end: int,
    target: BinaryIO | _Chained,
    labels: bytes,
    t_ns: int,
    drawn: Sequence[Stored],
) -> None:
    """Writes what follows byte ``end``: the messages from chunk ``place`` on, the labels, attachments, and the summary.
    The library writes this as the end of a file that starts with it; the part before is added to the summary later."""
    chunks = file.directory.chunks
    passed = [stored for at in range(place, len(chunks)) for stored in file.chunk(at)]
    kept = [stored for stored in passed if stored.channel.topic not in topics.OF_LABELS]
    log_time_ns = kept[-1].log_time_ns if kept else chunks[place - 1].end_ns
    writer = Writer(target, CHUNK_BYTES)  # type: ignore[arg-type]  # of a file it wants these three methods
    said = [*drawn, Stored(_LABELS, log_time_ns, t_ns, labels)]
    numbers = _register(writer, file, before, [each.channel for each in said])
    copied = Counter(before.statistics.channel_message_counts if before.statistics is not None else {})
    copied -= Counter(numbers[stored.channel] for stored in passed)
    sequences = Counter(copied)
    for channel, at_ns, published_ns, data in (*kept, *said):
        sequences[numbers[channel]] += 1
        writer.add_message(numbers[channel], at_ns, data, max(published_ns, 0), sequences[numbers[channel]])
    for attached in before.attachment_indexes:
        content = file.attachment(attached.name)
        if attached.offset >= end and content is not None:
            writer.add_attachment(attached.create_time, attached.log_time, attached.name, attached.media_type, content)
    for told in before.metadata_indexes:
        if told.offset >= end:
            writer.add_metadata(told.name, file.metadata(told.name) or {})
    if isinstance(target, _Chained):
        writer.flush()
        target.chain.link(is_last=True)
    writer.finish()
    _tell_of_all(target.file if isinstance(target, _Chained) else target, before, end, copied)


def _register(
    writer: Writer, file: McapFile, before: Summary, said: Sequence[topics.Channel]
) -> dict[topics.Channel, int]:
    """Register schemas and channels under their existing ids, and those of labels if missing."""
    for schema in (before.schemas[number] for number in sorted(before.schemas)):
        writer.register_schema(schema.name, schema.encoding, schema.data)
    numbers: dict[topics.Channel, int] = {}
    for channel in (before.channels[number] for number in sorted(before.channels)):
        number = writer.register_channel(channel.topic, channel.message_encoding, channel.schema_id, channel.metadata)
        numbers[file.directory.channels[channel.id]] = number
    for new in dict.fromkeys(said):
        if new not in numbers:
            schema_id = writer.register_schema(new.schema_name, new.schema_encoding, new.schema_data)
            numbers[new] = writer.register_channel(new.topic, new.message_encoding, schema_id)
    return numbers


def _tell_of_all(target: BinaryIO, before: Summary, end: int, copied: Counter[int]) -> None:
    """Replace the summary of the last part by that of the whole file. copied: messages of each channel in the first
    ``end`` bytes."""
    size = target.seek(0, os.SEEK_END)
    rest = read_summary(target, size)
    assert rest is not None, "what was just written can be read"
    assert rest.statistics is not None
    chunks = [index for index in before.chunk_indexes if index.chunk_start_offset < end] + rest.chunk_indexes
    attachments = [index for index in before.attachment_indexes if index.offset < end] + rest.attachment_indexes
    metadata = [index for index in before.metadata_indexes if index.offset < end] + rest.metadata_indexes
    counts = copied + Counter(rest.statistics.channel_message_counts)
    statistics = Statistics(
        attachment_count=len(attachments),
        channel_count=len(rest.channels),
        channel_message_counts=dict(sorted(counts.items())),
        chunk_count=len(chunks),
        message_count=counts.total(),
        message_end_time=max(index.message_end_time for index in chunks),
        message_start_time=min(index.message_start_time for index in chunks),
        metadata_count=len(metadata),
        schema_count=len(rest.schemas),
    )
    groups: dict[int, Sequence[McapRecord]] = {
        Opcode.SCHEMA: list(rest.schemas.values()),
        Opcode.CHANNEL: list(rest.channels.values()),
        Opcode.STATISTICS: [statistics],
        Opcode.CHUNK_INDEX: chunks,
        Opcode.ATTACHMENT_INDEX: attachments,
        Opcode.METADATA_INDEX: metadata,
    }
    start = summary_start(target, size)
    target.truncate(start)
    target.seek(start)
    target.write(_summary(groups, start) + MCAP0_MAGIC)


def _summary(groups: Mapping[int, Sequence[McapRecord]], start: int) -> bytes:
    """The summary section of a file, at offset ``start``, including the footer: records by kind, the offset of each
    kind, and the checksum of the section."""
    records, offsets = RecordBuilder(), []
    for kind, group in groups.items():
        first = records.count
        for record in group:
            record.write(records)
        offsets.append(SummaryOffset(kind, start + first, records.count - first))
    offsets_start = start + records.count
    for offset in offsets:
        offset.write(records)
    data = records.end()
    footer = RecordBuilder()
    Footer(start, offsets_start, 0).write(footer)
    unsigned = footer.end()[:-_CRC_BYTES]
    return data + unsigned + zlib.crc32(unsigned, zlib.crc32(data)).to_bytes(_CRC_BYTES, "little")
