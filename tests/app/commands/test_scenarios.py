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


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        pytest.param(["--suite", "nonsense"], "'nonsense'", id="no such suite"),
        pytest.param(["--jobs", "-2"], "--jobs -2", id="fewer than no processes"),
        pytest.param(["--report", "."], "directory", id="a folder as the report"),
    ],
)
def test_bad_usage_is_named_before_anything_is_driven(
    arguments: list[str], named: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.commands.scenarios.run_all", lambda *_: pytest.fail("it drove"))
    with pytest.raises(SystemExit) as ended:
        main(["scenarios", "run", *arguments])
    assert ended.value.code == 2
    assert named in capsys.readouterr().err
