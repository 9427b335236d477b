"""The list of frames at a session's end: drives are described by it alone, and without it all the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.recording import topics
from pipeline.recording.mcap.reader import McapFile
from pipeline.recording.rewrite import clip, recover
from pipeline.recording.session.frame_list import listed_records
from pipeline.recording.session.source import SessionSource
from pipeline.types import Frame
from tests.pipeline.recording.frames import CAMERA, full, write


def opened(path: Path) -> SessionSource:
    return SessionSource(str(path), str(path))


def known(frames: list[Frame]) -> list[tuple[object, ...]]:
    return [(each.index, each.name, each.t_ns, each.ego, each.gnss, each.streams, each.notes) for each in frames]


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    moved = replace(CAMERA, width=64)
    frames = [replace(full(index), camera=CAMERA if index < 3 else moved) for index in range(6)]
    return write(tmp_path / "drive.mcap", frames)


def spoil(path: Path, offset: int, length: int) -> None:
    with path.open("r+b") as file:
        file.seek(offset)
        file.write(bytes(length))


def test_a_drive_is_described_without_its_chunks(drive: Path) -> None:
    session = opened(drive)
    whole = [session.frame(index) for index in range(len(session))]
    fixes = session.fixes()
    for entry in session.file.directory.chunks:
        spoil(drive, entry.offset + 9, entry.length - 9)
    again = opened(drive)
    outlines = list(again.outlines())
    assert known(outlines) == known(whole)
    assert [each.camera.width for each in outlines if each.camera] == [32] * 3 + [64] * 3
    assert again.fixes() == fixes
    assert not again.file.damaged
    assert again.frame(0).sweep is None, "the chunks could still be read: this test shows nothing"


@pytest.mark.parametrize("part", ["its beginning", "its middle", "its end"])
def test_a_damaged_list_is_made_up_for(part: str, drive: Path) -> None:
    session = opened(drive)
    outlines = list(session.outlines())
    offset, length = session.file.directory.attachments[topics.TICKS]
    data_offset, size = offset + length - 4, len(session.file.attachment(topics.TICKS) or b"")
    place = {"its beginning": data_offset - size, "its middle": data_offset - size // 2, "its end": data_offset - 8}
    spoil(drive, place[part], 8)
    assert known(list(opened(drive).outlines())) == known(outlines)


def test_a_session_without_the_list_is_read(drive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = opened(drive)
    outlines = list(session.outlines())
    monkeypatch.setattr(session.file, "attachment", lambda name: None)
    assert known(list(session.outlines())) == known(outlines)


def test_clips_and_recovered_files_have_the_list(drive: Path, tmp_path: Path) -> None:
    clip(opened(drive), 2, 4, tmp_path / "clip.mcap")
    recover(drive, tmp_path / "whole.mcap")
    for path, names in (("clip.mcap", ["000002", "000003", "000004"]), ("whole.mcap", [f"{i:06d}" for i in range(6)])):
        with McapFile(tmp_path / path) as file:
            assert [tick.name for tick in listed_records(file) if tick is not None] == names
