"""A file is replaced as a whole or not at all; a damaged one is kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.common.files.whole_files import replace_text, replacing, set_aside, written_text


def test_the_old_content_is_there_until_the_new_one_is_whole(tmp_path: Path) -> None:
    target = tmp_path / "new folder" / "marks.json"
    replace_text(target, "old")
    with replacing(target) as file:
        file.write("größer".encode())
        file.flush()
        assert target.read_text(encoding="utf-8") == "old"
    assert target.read_text(encoding="utf-8") == "größer"
    assert [each.name for each in target.parent.iterdir()] == ["marks.json"]


def write_half(target: Path) -> None:
    with replacing(target) as file:
        file.write(b"half")
        file.close()


def test_after_an_error_nothing_has_changed_and_nothing_is_left(tmp_path: Path) -> None:
    target = tmp_path / "marks.json"
    replace_text(target, "old")
    with pytest.raises(ValueError, match="closed"):
        write_half(target)
    assert target.read_text(encoding="utf-8") == "old"
    assert [each.name for each in tmp_path.iterdir()] == ["marks.json"]


def test_a_target_that_is_a_folder_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "marks.json").mkdir()
    with pytest.raises(OSError, match="directory"):
        replace_text(tmp_path / "marks.json", "new")
    assert [each.name for each in tmp_path.iterdir()] == ["marks.json"]


def test_files_set_aside_are_all_kept(tmp_path: Path) -> None:
    target = tmp_path / "marks.json"
    for content in ("one", "two"):
        target.write_text(content)
        set_aside(target)
        assert not target.exists()
    assert {each.read_text() for each in tmp_path.iterdir()} == {"one", "two"}


FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")
def test_a_full_disk_is_said_with_the_file() -> None:
    with pytest.raises(OSError, match="full") as found, written_text(FULL) as file:  # noqa: PT012
        file.write("x" * 100_000)
        file.flush()
    assert found.value.filename == str(FULL)


def test_an_error_of_something_else_is_not_the_files(tmp_path: Path) -> None:
    with pytest.raises(ConnectionError) as found, written_text(tmp_path / "a.jsonl"):
        raise ConnectionError("the sensor is gone")
    assert found.value.filename is None
