"""A session that was changed anywhere says so and where; one that was written, labelled or clipped here is intact."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.recording.info import info
from pipeline.recording.mcap import output as mcap_output
from pipeline.recording.mcap.chain import NAME, Chain, verify
from pipeline.recording.mcap.reader import McapFile
from pipeline.recording.relabel import relabel
from pipeline.recording.rewrite import clip, recover
from pipeline.recording.session.source import SessionSource
from tests.pipeline.recording.frames import full, sweep, write

INTACT = Chain("intact")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of several chunks."""
    frames = [replace(full(index), sweep=sweep(index, points=1500)) for index in range(8)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mcap_output, "CHUNK_BYTES", 64 * 1024)
        return write(tmp_path_factory.mktemp("whole") / "a.mcap", frames)


def test_what_this_program_writes_is_intact(whole: Path, tmp_path: Path) -> None:
    assert info(whole).chain == INTACT
    assert info(whole, is_quick=True).chain is None
    with McapFile(whole) as file:
        assert relabel(file, tmp_path / "labelled.mcap", b"{}", 5)
        labelled = (tmp_path / "labelled.mcap").read_bytes()
        assert labelled.count(NAME.encode()) == len(file.directory.chunks) + 1, "the chain goes on in its last part"
    with McapFile(tmp_path / "labelled.mcap") as file:
        assert relabel(file, tmp_path / "again.mcap", b"[]", 5)
    clip(SessionSource("a", str(whole)), 2, 5, tmp_path / "clip.mcap")
    recover(whole, tmp_path / "recovered.mcap")
    for name in ("labelled", "again", "clip", "recovered"):
        assert verify(tmp_path / f"{name}.mcap") == INTACT, name


def test_a_bit_that_is_changed_is_found_wherever_it_is_and_the_place_is_said(whole: Path, tmp_path: Path) -> None:
    data, path = whole.read_bytes(), tmp_path / "a.mcap"
    with McapFile(whole) as file:
        chunk = file.directory.chunks[2]
    for place in (9, chunk.offset + 200, *range(20, len(data) - 100, len(data) // 40)):
        changed = bytearray(data)
        changed[place] ^= 1
        path.write_bytes(changed)
        found = verify(path)
        assert found.state in ("changed", "cut off"), place
        if place == chunk.offset + 200:
            (said,) = found.changed
            begin, end = (int(word.replace(",", "")) for word in said.split()[1:4:2])
            assert begin <= chunk.offset <= end <= chunk.offset + chunk.length + 20_000


def test_a_part_taken_out_or_put_in_twice_is_found(whole: Path, tmp_path: Path) -> None:
    data, path = whole.read_bytes(), tmp_path / "a.mcap"
    with McapFile(whole) as file:
        first, second = (file.directory.chunks[k].offset for k in (2, 3))
    for changed in (data[:first] + data[second:], data[:second] + data[first:second] + data[second:]):
        path.write_bytes(changed)
        assert "was removed or inserted" in verify(path).changed[0]


def test_one_that_was_cut_is_intact_as_far_as_it_goes_and_an_old_one_has_no_chain(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    assert verify(cut) == Chain("cut off")
    monkeypatch.setattr(mcap_output._Stream, "write", lambda self, data: self.file.write(data))
    monkeypatch.setattr("pipeline.recording.mcap.chain.ChainWriter.link", lambda self, is_last=False: None)
    assert verify(write(tmp_path / "old.mcap", [full(0)])) == Chain("not chained")
