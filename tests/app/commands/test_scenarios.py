"""`cipv scenarios run` as a person types it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from app.cli import main
from app.commands import scenarios
from pipeline.evaluation.experiments.sections import Section
from pipeline.params import Params, from_yaml
from pipeline.sources import open_source


def test_a_short_experiment_as_json_and_as_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "out" / "report.html"
    with pytest.raises(SystemExit) as ended:
        main(["scenarios", "run", "--suite", "braking", "--short", "--jobs", "1", "--json", "--report", str(page)])
    assert ended.value.code == 0
    (section,) = json.loads(capsys.readouterr().out)
    assert section["name"] == "braking"
    assert {row[1] for row in section["tables"][0]["rows"]} == {"LiDAR", "fused"}
    assert "CCRs: speed" in page.read_text(encoding="utf-8")


def test_cells_of_the_report_lead_to_the_drives_behind_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report, drives = tmp_path / "ncap.html", tmp_path / "drives"
    with pytest.raises(SystemExit) as ended:
        main(
            [
                "scenarios",
                "run",
                "--suite",
                "ncap",
                "--short",
                "--jobs",
                "1",
                "--report",
                str(report),
                "--drives",
                str(drives),
            ]
        )
    assert ended.value.code == 0
    links = re.findall(r'href="(drives/[^"#]+)\.html"', report.read_text(encoding="utf-8"))
    assert links
    for link in links:
        page = (tmp_path / f"{link}.html").read_text(encoding="utf-8")
        assert "<svg" in page
        assert "cipv serve" in page
        assert len(open_source(f"sim:{tmp_path / link}.yaml")) > 10
        assert from_yaml(tmp_path / f"{link}.params.yaml", Params()).acc.brake_limit_mps2 == 0.0, "AEB alone"


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


@pytest.mark.parametrize(("failures", "code"), [((), 0), (("Left turn: fused is wrong",), 1)])
def test_a_demand_that_does_not_hold_fails_the_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], failures: tuple[str, ...], code: int
) -> None:
    """The figures are written all the same."""
    section = Section("choosing", "Choosing", failures=failures)
    monkeypatch.setattr(scenarios, "run_all", lambda *_: [section])
    with pytest.raises(SystemExit) as ended:
        main(["scenarios", "run", "--suite", "choosing", "--json"])
    assert ended.value.code == code
    out, err = capsys.readouterr()
    assert json.loads(out)[0]["failures"] == list(failures)
    assert ("does not hold: Left turn" in err) is bool(failures)
