"""A file that is missing in a recording of several, or was replaced, is noticed in those beside it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from pipeline.recording.info import info
from pipeline.recording.mcap.chain import verify
from pipeline.recording.mcap.reader import McapFile
from pipeline.recording.relabel import relabel
from pipeline.recording.rewrite import clip, recover
from pipeline.recording.segments import FileRotation, Segments
from pipeline.recording.session.source import SessionSource
from tests.pipeline.recording.frames import ABOUT, full

NAMES = ("a.mcap", "a_001.mcap", "a_002.mcap")


def record(folder: Path, first: int = 0) -> list[Path]:
    folder.mkdir(exist_ok=True)
    parts = Segments(folder / "a.mcap", ABOUT, FileRotation(max_s=0.2))
    for index in range(first, first + 8):
        parts.write(full(index))
    parts.close()
    assert [file.name for file in parts.files] == list(NAMES)
    return parts.files


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    return record(tmp_path / "drive")


def problems(file: Path) -> tuple[str, ...]:
    return info(file, is_quick=True).missing_neighbours


def test_all_of_a_recording_are_beside_each_other(files: list[Path]) -> None:
    assert [(verify(file).state, problems(file)) for file in files] == [("intact", ())] * 3


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_any_that_is_removed_is_missed(files: list[Path], missing: int) -> None:
    files.pop(missing).unlink()
    said = " ".join(text for file in files for text in problems(file))
    assert f"{NAMES[missing]}, in which the recording continues, is not beside it" in said or missing == 0
    assert f"the file before it, {NAMES[missing]}, is not beside it" in said or missing == 2


@pytest.mark.parametrize("replaced", [0, 1, 2])
def test_any_that_is_replaced_by_another_recordings_is_noticed(
    files: list[Path], tmp_path: Path, replaced: int
) -> None:
    other = record(tmp_path / "other", first=100)
    shutil.copy(other[replaced], files[replaced])
    said = " ".join(text for file in files for text in problems(file))
    assert f"{NAMES[replaced]} is not the file" in said
    assert verify(files[replaced]).state == "intact", "by itself, it is"


def test_one_that_was_labelled_is_still_itself(files: list[Path]) -> None:
    for file in files:
        with McapFile(file) as read:
            assert relabel(read, file.with_suffix(".new"), b"{}", 5)
        file.with_suffix(".new").replace(file)
    assert [(verify(file).state, problems(file)) for file in files] == [("intact", ())] * 3


def test_a_copy_of_a_part_belongs_to_no_others(files: list[Path], tmp_path: Path) -> None:
    clip(SessionSource("a", str(files[1])), 0, 1, tmp_path / "clip.mcap")
    recover(files[1], tmp_path / "recovered.mcap")
    assert [problems(tmp_path / name) for name in ("clip.mcap", "recovered.mcap")] == [(), ()]


@pytest.mark.parametrize("name", ["../drive/a.mcap", "", "/etc/passwd", "..", "a" * 300, "a\0", "\ud800"])
def test_only_files_in_the_same_folder_are_looked_at(
    files: list[Path], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(McapFile, "metadata", lambda *_: {"file": name, "sha256": "0"})
    assert problems(files[1]) == (
        f"the file before it, {name}, is not beside it",
        f"{name}, in which the recording continues, is not beside it",
    )
