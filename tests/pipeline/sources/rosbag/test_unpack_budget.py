"""A bag of kilobytes that unpacks to gigabytes is refused before it takes the memory."""

from __future__ import annotations

import bz2
import tracemalloc
from pathlib import Path

import lz4.frame
import pytest
from lz4.frame import LZ4FrameDecompressor
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import reader as rosbag2

from pipeline.recording.mcap.index import MAGIC
from pipeline.sources import SourceError, open_source
from pipeline.sources.rosbag import unpack_budget
from pipeline.sources.rosbag.unpack_budget import TooLarge, bounded
from tests.pipeline.sources.made.bags import write_bag

unpack_budget.install()
MANY = bytes(64 << 20)
KINDS = {
    "bz2": (bz2.compress, bz2.BZ2Decompressor),
    "lz4": (lz4.frame.compress, LZ4FrameDecompressor),
    "zstd": (rosbag2.zstd._module.compress, rosbag2.zstd._module.ZstdDecompressor),
}


@pytest.mark.parametrize("kind", KINDS)
def test_no_more_is_unpacked_than_may_be(kind: str) -> None:
    pack, new = KINDS[kind]
    packed = pack(MANY)
    assert bounded(new, len(MANY))(packed) == MANY
    tracemalloc.start()
    try:
        with pytest.raises(TooLarge):
            bounded(new, 1 << 20)(packed)
        assert tracemalloc.get_traced_memory()[1] < 8 << 20
    finally:
        tracemalloc.stop()
    with pytest.raises(ValueError, match="cut off"):
        bounded(new, len(MANY))(packed[: len(packed) // 2])


@pytest.mark.parametrize("fmt", [Writer1.CompressionFormat.BZ2, Writer1.CompressionFormat.LZ4])
def test_a_bag_whose_chunk_swells_is_read_without_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fmt: Writer1.CompressionFormat
) -> None:
    write = Writer1.__init__

    def compressing(self: Writer1, path: Path) -> None:
        write(self, path)
        self.set_compression(fmt)

    monkeypatch.setattr(Writer1, "__init__", compressing)
    path = write_bag(tmp_path / "recording.bag", kind="ros1")
    assert len(open_source(f"rosbag:{path}"))
    monkeypatch.setattr(unpack_budget.rosbag1, "decompressors", dict(unpack_budget.rosbag1.decompressors))
    unpack_budget.rosbag1.decompressors |= {
        "bz2": bounded(bz2.BZ2Decompressor, 1000),
        "lz4": bounded(LZ4FrameDecompressor, 1000),
    }
    with pytest.raises(SourceError, match="unpacks to more than"):
        open_source(f"rosbag:{path}")


BAGS = {
    "no.bag": b"",
    "header.bag": b"#ROSBAG V2.0\n\xff\xff\xff\xff",
    "header.mcap": b"\x89MCAP0\r\n\x01" + (1 << 40).to_bytes(8, "little"),
}


@pytest.mark.parametrize("name", BAGS)
def test_a_record_of_gigabytes_in_a_file_that_takes_no_disk_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(unpack_budget, "LARGEST_CHUNK_BYTES", 1 << 20)
    path = tmp_path / name
    with path.open("wb") as file:
        file.write(BAGS[name])
        file.truncate(64 << 20)
    open_source_of(path)  # what is imported at first does not count
    tracemalloc.start()
    try:
        assert open_source_of(path) == f"{name}: cannot be read as a bag: a record of more than 1 MB"
        assert tracemalloc.get_traced_memory()[1] < 8 << 20
    finally:
        tracemalloc.stop()


def test_zeros_that_take_no_disk_are_not_read_as_records(tmp_path: Path) -> None:
    """A hundred million of them here."""
    path = tmp_path / "hole.mcap"
    header = record(1, b"".join(len(text).to_bytes(4, "little") + text for text in (b"ros2", b"")))
    begin, end = MAGIC + header, record(15, bytes(4)) + record(2, bytes(20)) + MAGIC
    with path.open("wb") as file:
        file.write(begin)
        file.seek(900 << 20)
        file.write(end)
    said = f"hole.mcap has no index, and is damaged after {len(begin)} bytes"
    assert open_source_of(path) == f"hole.mcap: cannot be read as a bag: {said}"
    path.write_bytes(begin + end)
    assert "damaged" not in open_source_of(path), "without them it is only empty"


def record(opcode: int, content: bytes) -> bytes:
    return bytes([opcode]) + len(content).to_bytes(8, "little") + content


def open_source_of(path: Path) -> str:
    """What is said about a bag that cannot be opened."""
    with pytest.raises(SourceError) as raised:
        open_source(f"rosbag:{path}")
    return str(raised.value)
