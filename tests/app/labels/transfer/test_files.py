"""Uploaded .zip files: bombs and lies are refused in one sentence, and unpacking takes no memory."""

from __future__ import annotations

import io
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from app.labels.transfer import files
from app.labels.transfer.files import _unzipped
from pipeline.common.errors import BadInput

CENTRAL = b"PK\x01\x02"
LOCAL = b"PK\x03\x04"


def packed(content: dict[str, bytes], how: int = zipfile.ZIP_DEFLATED) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", how) as made:
        for name, each in content.items():
            made.writestr(name, each)
    return data.getvalue()


def with_size(data: bytes, size: int) -> bytes:
    """Its first file declares another unpacked size, in both headers."""
    changed = bytearray(data)
    struct.pack_into("<I", changed, changed.index(CENTRAL) + 24, size)
    struct.pack_into("<I", changed, changed.index(LOCAL) + 22, size)
    return bytes(changed)


def two_names_of_one_file() -> bytes:
    """The second entry of the directory points to the data of the first, as in bombs of overlapping files."""
    data = bytearray(packed({"a.txt": bytes(1 << 20), "b.txt": b"b"}))
    second = data.index(CENTRAL, data.index(CENTRAL) + 4)
    struct.pack_into("<I", data, second + 42, 0)
    return bytes(data)


def with_large_size_of_zip64() -> bytes:
    """The unpacked size is in the ZIP64 field, and more than a terabyte."""
    data, end = packed({"a.txt": b"a"}), b"PK\x05\x06"
    central = bytearray(data[data.index(CENTRAL) : data.index(end)])
    field = struct.pack("<HHQ", 1, 8, 1 << 40)
    struct.pack_into("<I", central, 24, 0xFFFFFFFF)
    struct.pack_into("<H", central, 30, len(field))
    tail = bytearray(data[data.index(end) :])
    struct.pack_into("<I", tail, 12, len(central) + len(field))
    return data[: data.index(CENTRAL)] + central + field + tail


BOMBS: dict[str, tuple[Callable[[], bytes], str]] = {
    "42.zip": (lambda: with_size(packed({"a.txt": bytes(1 << 20)}), 4_000_000_000), "unpacks to more than"),
    "declared too small": (lambda: with_size(packed({"a.txt": bytes(1 << 20)}), 1000), "not a valid .zip"),
    "zip64": (with_large_size_of_zip64, "unpacks to more than"),
    "overlapping": (two_names_of_one_file, "not a valid .zip"),
    "lzma": (lambda: packed({"a.txt": b"a"}, zipfile.ZIP_LZMA), "not packed with deflate"),
    "same name twice": (lambda: packed({"a.txt": b"a", "b.txt": b"b"}).replace(b"b.txt", b"a.txt"), "not a valid .zip"),
    "upwards": (lambda: packed({"../a.txt": b"a"}), "outside its folder"),
    "file below a file": (lambda: packed({"a": b"a", "a/b": b"b"}), "not a valid .zip"),
}


@pytest.mark.parametrize("what", BOMBS)
def test_a_bomb_is_refused_in_one_line_and_leaves_nothing_large(what: str, tmp_path: Path) -> None:
    make, says = BOMBS[what]
    file, out = tmp_path / "a.zip", tmp_path / "out"
    file.write_bytes(make())
    out.mkdir()
    with pytest.raises(BadInput, match=says) as caught:
        _unzipped(file, out)
    assert "\n" not in str(caught.value)
    assert sum(each.stat().st_size for each in out.rglob("*") if each.is_file()) <= 1 << 20


def test_a_zip_in_a_zip_is_a_file_like_any_other(tmp_path: Path) -> None:
    """So one that contains itself is unpacked once."""
    inner = packed({"b.txt": bytes(1 << 20)})
    (tmp_path / "a.zip").write_bytes(packed({"inner.zip": inner, "a.txt": b"a"}))
    (tmp_path / "out").mkdir()
    assert (_unzipped(tmp_path / "a.zip", tmp_path / "out") / "inner.zip").read_bytes() == inner


def test_a_large_file_is_unpacked_a_piece_at_a_time(tmp_path: Path) -> None:
    (tmp_path / "a.zip").write_bytes(packed({"a.txt": bytes(64 << 20)}))
    (tmp_path / "out").mkdir()
    tracemalloc.start()
    try:
        _unzipped(tmp_path / "a.zip", tmp_path / "out")
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert (tmp_path / "out" / "a.txt").stat().st_size == 64 << 20
    assert most < 16 * files._PIECE_BYTES
