"""Files that commands write are checked at their beginning, and what a person may have made is never overwritten."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import ensure_new, ensure_writable, open_new, write_new, write_new_files


def test_a_file_that_is_written_later_is_not_left_behind_empty(tmp_path: Path):
    ensure_writable(tmp_path / "new" / "report.html")
    assert [path.name for path in tmp_path.rglob("*")] == ["new"]


def test_a_file_that_is_there_stays_as_it_is(tmp_path: Path):
    (tmp_path / "report.html").write_text("before", encoding="utf-8")
    ensure_writable(tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == "before"


def test_what_cannot_be_written_is_an_error(tmp_path: Path):
    with pytest.raises(IsADirectoryError):
        ensure_writable(tmp_path)


def test_a_file_that_exists_is_never_overwritten(tmp_path: Path):
    file = tmp_path / "rig.yaml"
    ensure_new(file)
    write_new(file, "by hand: ü\n")
    for write in (ensure_new, open_new, lambda path: write_new(path, "computed")):
        with pytest.raises(BadInput, match=r"rig\.yaml: file already exists; choose another name"):
            write(file)
    assert file.read_text(encoding="utf-8") == "by hand: ü\n"


def test_files_of_a_folder_are_written_together_or_not_at_all(tmp_path: Path):
    write_new_files(tmp_path / "new", {"a": "1", "b": "2"})
    assert (tmp_path / "new" / "b").read_text(encoding="utf-8") == "2"
    with pytest.raises(BadInput, match=r"new/b: file already exists"):
        write_new_files(tmp_path / "new", {"c": "3", "b": "4"})
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["a", "b"]
    with pytest.raises(BadInput, match=r"new/a: file already exists"):
        write_new_files(tmp_path / "new" / "a", {"c": "3"})
