"""Files of a command's end are checked at its beginning."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.commands.support.output_files import ensure_writable


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
