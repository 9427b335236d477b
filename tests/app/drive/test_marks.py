"""Moments that a person marked."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.drive.marks import LIVE, MOST_MARKS, MarkRefused, Marks, SavedMark


def test_marks_come_by_frame_and_are_the_recordings_own():
    marks = Marks()
    marks.add("sim:a", 9, "later")
    marks.add("sim:a", 3, "  two   words ")
    marks.add("sim:b", 1)
    assert marks.of("sim:a") == [SavedMark(2, 3, "two words"), SavedMark(1, 9, "later")]
    assert marks.remove("sim:a", 2)
    assert not marks.remove("sim:a", 2)
    assert not marks.remove("sim:b", 9)
    assert [mark.index for mark in marks.of("sim:a")] == [9]


def test_marks_are_still_there_when_the_server_starts_again(tmp_path: Path):
    folder = tmp_path / "marks"
    Marks(folder).add("../../etc:x", 4, "Bremslicht ü")
    assert Marks(folder).of("../../etc:x") == [SavedMark(1, 4, "Bremslicht ü")]
    assert [file.parent for file in tmp_path.rglob("*.json")] == [folder], "a URI is no path"


def test_a_mark_of_live_sensors_keeps_its_time(tmp_path: Path):
    Marks(tmp_path).add(LIVE, 5, "here", t_ns=17 * 10**17, in_session=True)
    assert Marks(tmp_path).of(LIVE) == [SavedMark(1, 5, "here", 17 * 10**17, in_session=True)]
    (file,) = tmp_path.iterdir()
    file.write_text('{"marks": [{"id": 3, "index": 4, "text": "before marks had times"}]}')
    assert Marks(tmp_path).of(LIVE) == [SavedMark(3, 4, "before marks had times")]


@pytest.mark.parametrize(
    "content",
    [
        *("", "{", "[]", "\x00", "[" * 100_000),
        *('{"marks": 3}', '{"marks": [{"id": "x"}]}', '{"marks": [3]}', '{"marks": [{"id": 1e999}]}'),
    ],
)
def test_a_damaged_file_holds_no_marks_and_is_not_overwritten(tmp_path: Path, content: str):
    marks = Marks(tmp_path)
    marks.add("sim:a", 4)
    (file,) = tmp_path.iterdir()
    file.write_text(content)
    again = Marks(tmp_path)
    assert again.of("sim:a") == []
    again.add("sim:a", 7)
    assert [mark.index for mark in Marks(tmp_path).of("sim:a")] == [7]
    assert file.with_name(f"{file.name}.damaged").read_text() == content


def test_a_folder_that_cannot_be_written_refuses_the_mark(tmp_path: Path):
    (tmp_path / "file").write_text("in the way")
    marks = Marks(tmp_path / "file")
    with pytest.raises(MarkRefused, match="cannot be saved"):
        marks.add("sim:a", 4)
    assert marks.of("sim:a") == []


def test_a_recording_holds_so_many_marks():
    marks = Marks()
    marks._marks["sim:a"] = [SavedMark(number + 1, 0) for number in range(MOST_MARKS)]
    with pytest.raises(MarkRefused, match="at most"):
        marks.add("sim:a", 4)
