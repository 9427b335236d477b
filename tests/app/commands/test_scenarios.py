"""`cipv scenarios run` as a person types it."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from urllib.parse import quote, unquote

import pytest

from app.cli import main
from app.commands import scenarios
from app.reports.html import html
from pipeline.common.fast_replace import evolve
from pipeline.evaluation.report_sections import ReportSection
from pipeline.experiments.euro_ncap.experiment import NCAP
from pipeline.experiments.paper import braking
from pipeline.experiments.straight_track import DriveRecord
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
    assert page.read_text(encoding="utf-8").count("data:image/jpeg") == len(
        {row[0] for row in section["tables"][0]["rows"]}
    )


def test_the_report_leads_to_every_drive_wherever_both_are_moved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made, moved = tmp_path / "made", tmp_path / "moved here"
    arguments = ["--suite", "euroncap", "--short", "--jobs", "1"]
    with pytest.raises(SystemExit) as ended:
        main(
            ["scenarios", "run", *arguments, "--report", str(made / "ncap.html"), "--drives", str(made / "all drives")]
        )
    assert ended.value.code == 0
    count = len(NCAP.cases(True))
    assert f"{count} drives saved: {made / 'all drives' / 'index.html'}" in capsys.readouterr().err
    made.rename(moved)
    report = (moved / "ncap.html").read_text(encoding="utf-8")
    cells = set(re.findall(r'href="all%20drives/([^"#]+)\.html"', report))
    assert 'href="all%20drives/index.html#ncap"' in report
    listed = set(
        re.findall(r'href="([^"#]+)\.html"', (moved / "all drives" / "index.html").read_text(encoding="utf-8"))
    )
    assert cells == listed == {quote(case.name) for case in NCAP.cases(True)}
    assert not [file for file in moved.rglob("*.*") if str(tmp_path) in file.read_text(encoding="utf-8")]
    for name in map(unquote, listed):
        file = moved / "all drives" / name
        page = Path(f"{file}.html").read_text(encoding="utf-8")
        assert "<svg" in page
        assert f"cipv serve {shlex.quote(f'sim:{name}.yaml')}" in page
        assert "aeb.enabled" not in page
        assert "acc.brake_limit_mps2" in unquote(page), "the link carries what it drove with: AEB alone"
        source = open_source(f"sim:{file}.yaml")
        assert len(source) > 10
        assert ("LiDAR alone" in " ".join(source.notes)) is ("_lidar_" in name)
        assert from_yaml(Path(f"{file}.params.yaml"), Params()).acc.brake_limit_mps2 == 0.0, "AEB alone"


def test_the_worst_drives_are_linked_from_the_braking_table(tmp_path: Path) -> None:
    case, lidar = braking.BrakingCase("CCRs", "both", "ACC", 0), braking.BrakingCase("CCRs", "lidar", "ACC", 0)
    gap_m, unseen, off = (9.0, 7.0), (None, None), ("off", "off")
    drive = DriveRecord((0.0, 0.1), (20.0, 19.0), (0.0, -1.0), gap_m, (0.0, 0.0), unseen, off, None, None, 5.0)
    twin = evolve(drive, impact_mps=8.0)
    again = evolve(case, seed=1)
    pair = [evolve(each, controller="ACC + AEB") for each in (case, lidar)]
    section = braking.report([case, again, *pair], [drive, twin, drive, drive])
    page = html([section], "Braking", "drives/")
    assert f'href="drives/{again.name}.html"' in page
    assert f'href="drives/{case.name}.html"' not in page


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
    """The figures are written nevertheless."""
    section = ReportSection("choosing", "Choosing", failures=failures)
    monkeypatch.setattr(scenarios, "run_all", lambda *_: [section])
    with pytest.raises(SystemExit) as ended:
        main(["scenarios", "run", "--suite", "choosing", "--json"])
    assert ended.value.code == code
    out, err = capsys.readouterr()
    assert json.loads(out)[0]["failures"] == list(failures)
    assert ("FAILED: Left turn" in err) is bool(failures)


def test_kilometres_are_for_the_robustness_suite_alone(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["--suite", "iso", "--km", "5"], ["--suite", "robustness", "--km", "0"]):
        with pytest.raises(SystemExit) as ended:
            main(["scenarios", "run", *arguments])
        assert ended.value.code not in (0, None)
    told = capsys.readouterr().err
    assert "--suite robustness" in told
    assert "expected 1 to" in told
