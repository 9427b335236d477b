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
