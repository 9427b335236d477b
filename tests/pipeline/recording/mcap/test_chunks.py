"""What a chunk of a session holds: a seek reads little else than its frame, and what is kept is counted right."""

from __future__ import annotations

import resource
import struct
from dataclasses import replace
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard

from pipeline.recording import topics
from pipeline.recording.errors import Damaged
from pipeline.recording.mcap import output as mcap_output
from pipeline.recording.mcap.chunk import unpack
from pipeline.recording.mcap.reader import McapFile
from pipeline.recording.session.writer import SessionWriter
from tests.pipeline.recording.frames import ABOUT, full, image, sweep, write


def test_a_full_frame_is_one_chunk(tmp_path: Path) -> None:
    """A seek then reads only data of its frame."""
    jpeg = b"\xff\xd8" + bytes(np.random.default_rng(0).integers(0, 255, 400_000, dtype=np.uint8))
    frames = [
        replace(full(index), sweep=sweep(index, points=28_000), image=replace(image(index), encoded=jpeg[:-index]))
        for index in range(1, 6)
    ]
    with McapFile(write(tmp_path / "a.mcap", frames)) as file:
        starts = [{stored.log_time_ns for stored in file.chunk(place)} for place in range(len(file.directory.chunks))]
    assert [len(times) for times in starts] == [1] * 5


@pytest.mark.parametrize("chunk_bytes", [500, 2_000, 4_000, 9_000])
def test_frames_said_to_be_kept_are_in_the_file(
    chunk_bytes: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wherever a chunk begins, including between the messages of a frame."""
    monkeypatch.setattr(mcap_output, "CHUNK_BYTES", chunk_bytes)
    writer = SessionWriter(tmp_path / "a.mcap", ABOUT)
    for index in range(12):
        writer.write(full(index), {"frame": index})
        copy = tmp_path / f"{index}.mcap"
        copy.write_bytes((tmp_path / "a.mcap").read_bytes())
        with McapFile(copy, walk=True) as file:
            assert writer.kept_frames == sum(1 for _ in file.messages((topics.FRAMES,)))
    writer.close()
    assert writer.kept_frames == 12


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_never_unpacks_to_more_than_it_says(compression: str) -> None:
    """80 MB of zeros in a chunk that claims to contain one kilobyte."""
    zeros = bytes(80_000_000)
    packed = zstandard.compress(zeros) if compression == "zstd" else lz4.frame.compress(zeros)
    head = (
        struct.pack("<QQQII", 0, 0, 1000, 0, len(compression)) + compression.encode() + struct.pack("<Q", len(packed))
    )
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(Exception, match=r"larger than declared|invalid records|requires a buffer"):
        unpack(head + packed)
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < 40_000_000


RECORD = struct.Struct("<BQ")
HEAD = struct.Struct("<HIQQ")


def chunk_of(data: bytes) -> bytes:
    """Content of a chunk's record."""
    packed = zstandard.compress(data)
    return struct.pack("<QQQII", 0, 0, len(data), 0, 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (bytes(9 * 1_000), "invalid records"),
        (RECORD.pack(0x80, 0) * 1_000_001, "too many"),
        ((RECORD.pack(5, HEAD.size) + HEAD.pack(1, 0, 0, 0)) * 1_000_001, "too many"),
        (RECORD.pack(5, HEAD.size - 1) + bytes(HEAD.size), "within its header"),
    ],
    ids=["zeros", "unknown", "empty messages", "short message"],
)
def test_a_chunk_of_nothing_is_refused_before_it_takes_a_minute(data: bytes, says: str) -> None:
    """Zeros compress to nothing, and are 28 million records of 9 bytes in the largest chunk."""
    with pytest.raises(Damaged, match=says):
        unpack(chunk_of(data))


def test_unknown_records_in_a_chunk_are_skipped() -> None:
    data = RECORD.pack(0x80, 3) + b"abc" + RECORD.pack(5, HEAD.size + 1) + HEAD.pack(1, 0, 7, 8) + b"x"
    (message,) = unpack(chunk_of(data)).messages
    assert (message.log_time_ns, data[message.start : message.end]) == (7, b"x")
