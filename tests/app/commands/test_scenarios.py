"""`cipv scenarios run` as a person types it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.cli import main


def test_a_short_experiment_as_json_and_as_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "out" / "report.html"
    with pytest.raises(SystemExit) as ended:
        main(["scenarios", "run", "--suite", "braking", "--short", "--jobs", "1", "--json", "--report", str(page)])
    assert ended.value.code == 0
    (section,) = json.loads(capsys.readouterr().out)
    assert section["name"] == "braking"
    assert {row[1] for row in section["tables"][0]["rows"]} == {"LiDAR", "fused"}
    assert "CCRs: speed" in page.read_text(encoding="utf-8")


def test_a_suite_that_does_not_exist_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["scenarios", "run", "--suite", "nonsense"])
    assert ended.value.code == 2
    assert "'nonsense'" in capsys.readouterr().err
