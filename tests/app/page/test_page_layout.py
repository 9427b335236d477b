"""The page's source files stay readable: short lines, small folders."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

STATIC = Path(__file__).resolve().parents[3] / "static"
MOST_COLUMNS, MOST_FILES, MOST_LINES = 120, 15, 300
FILES = sorted(path for path in STATIC.rglob("*") if path.suffix in {".js", ".css", ".html"})


def test_lines_have_at_most_120_characters() -> None:
    long = [
        f"{path.relative_to(STATIC)}:{number}"
        for path in FILES
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if len(line) > MOST_COLUMNS
    ]
    assert FILES
    assert long == []


def test_files_have_at_most_300_lines() -> None:
    assert [path.name for path in FILES if len(path.read_text(encoding="utf-8").splitlines()) > MOST_LINES] == []


def test_a_folder_holds_at_most_15_files() -> None:
    sizes = Counter(path.parent.relative_to(STATIC).as_posix() for path in FILES)
    assert {folder: count for folder, count in sizes.items() if count > MOST_FILES} == {}
