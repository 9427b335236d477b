"""The threat model names an asset, an attacker, a measure and tests that are there."""

from __future__ import annotations

import re

from tests.conftest import ROOT

COLUMNS = ("asset", "attacker", "measure", "test")


def rows() -> list[list[str]]:
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    table = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
    assert tuple(table[0]) == COLUMNS
    return table[2:]


def test_each_threat_has_all_four():
    assert len(rows()) > 20
    assert [row for row in rows() if len(row) != len(COLUMNS) or not all(cell.strip() for cell in row)] == []


def test_each_test_is_there_and_holds_tests():
    missing, folder = [], ROOT
    for row in rows():
        named = re.findall(r"`([^`]+)`", row[-1])
        assert named, row
        for name in named:
            if name.startswith("make "):
                assert f"\n{name.removeprefix('make ')}:" in (ROOT / "Makefile").read_text(encoding="utf-8"), name
                continue
            path = ROOT / name if "/" in name else folder / name
            folder = path.parent
            files = [path] if path.is_file() else sorted(path.rglob("test_*.py"))
            if not any("\ndef test_" in file.read_text(encoding="utf-8") for file in files):
                missing.append(name)
    assert missing == []
