"""Two runs over the same drives: scores in pairs, changes, events, and rules that must hold."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from app.cli import main
from app.drive.compare import SAME_PLACE_M
from app.fleet.batch.plan import Plan
from app.fleet.batch.work import run_drive
from app.fleet.compare.changes import changed_drives, changed_events
from app.fleet.compare.gate import broken, read_rules
from app.fleet.compare.paired import difference_interval, paired
from app.fleet.find import FleetTables
from app.fleet.pack import pack
from app.fleet.store import Store
from pipeline.common.errors import BadInput
from pipeline.params import Params, with_changes
from tests.app.fleet.fleets import begun, plan_of

BLIND = {"cluster.min_points": 50, "cluster.max_range_m": 10.0}
"""With these parameters, the LiDAR alone sees hardly anything."""


@pytest.fixture(scope="module")
def runs(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, str]:
    """The folder of a batch with two runs, and their names: one with default parameters, one nearly blind."""
    out = tmp_path_factory.mktemp("runs")
    sane = _ran(plan_of(fleet, sensors="lidar"), out)
    blind = _ran(plan_of(fleet, sensors="lidar", params=with_changes(Params(), BLIND)), out)
    return out, sane, blind


def _ran(plan: Plan, out: Path) -> str:
    work = begun(plan, out)
    for job in work.jobs:
        run_drive(job)
    pack(Store(str(out)), work.key.name)
    return work.key.name


def opened(runs: tuple[Path, str, str]) -> tuple[FleetTables, FleetTables]:
    out, sane, blind = runs
    return FleetTables(Store(str(out)), sane), FleetTables(Store(str(out)), blind)


def frames_of(out: Path, run: str) -> dict[tuple[str, int], tuple]:
    return {
        (file.parent.name, row["index"]): (row["cipv_id"], row["distance_m"], row["path_offset_m"])
        for file in out.glob(f"tables/frames/run={run}/*/part.parquet")
        for row in pq.read_table(file, partitioning=None).to_pylist()
    }


def same(a: tuple, b: tuple) -> bool:
    if a[0] is None or b[0] is None:
        return a[0] is b[0]
    near = [x is y if x is None or y is None else abs(x - y) <= SAME_PLACE_M for x, y in zip(a[1:], b[1:], strict=True)]
    return all(near)


def test_frames_with_another_lead_are_counted(runs: tuple[Path, str, str]):
    out, sane, blind = runs
    ours, theirs = frames_of(out, sane), frames_of(out, blind)
    changes, differing, frames = changed_drives(*opened(runs))
    expected = [at for at in ours if not same(ours[at], theirs[at])]
    assert (differing, frames) == (len(expected), len(ours))
    assert differing > 0
    assert sum(each.frames for each in changes) == differing
    assert [each.longest for each in changes] == sorted((each.longest for each in changes), reverse=True)
    first = changes[0]
    assert (f"drive={first.drive}", first.index) in expected
    assert first.text.startswith("base: a lead at ")
    assert changed_drives(opened(runs)[0], opened(runs)[0]) == ([], 0, len(ours))


def test_events_that_went_are_counted(runs: tuple[Path, str, str]):
    by_kind = {each.kind: each for each in changed_events(*opened(runs))}
    acquired = by_kind["first_acquisition"]
    assert acquired.base > acquired.run
    assert acquired.lost >= acquired.base - acquired.run
    assert acquired.gained == acquired.run - (acquired.base - acquired.lost)


def test_a_change_in_every_drive_is_sure_and_has_a_direction():
    base = [(f"d{n}", "jitter", 1.0 * n, 10.0) for n in range(1, 9)]
    worse = [(drive, score, over + 2.0, under) for drive, score, over, under in base]
    (score,) = paired(base, worse)
    assert (score.base, score.run) == (pytest.approx(0.45), pytest.approx(0.65))
    assert (score.drives, score.improved, score.worsened, score.verdict) == (8, 0, 8, "worse")
    assert score.interval is not None
    assert score.interval.low == pytest.approx(0.2)
    (back,) = paired(worse, base)
    assert back.verdict == "better"
    (few,) = paired(base[:3], worse[:3])
    assert few.verdict == "", "three drives tell nothing of others"


def test_a_change_to_and_fro_is_not_sure():
    base = [(f"d{n}", "jitter", 5.0, 10.0) for n in range(8)]
    run = [(f"d{n}", "jitter", 5.0 + (-1.0) ** n, 10.0) for n in range(8)]
    (score,) = paired(base, run)
    assert (score.improved, score.worsened, score.verdict) == (4, 4, "")
    assert paired(base, run, ["d0", "d2"])[0].worsened == 2


def test_the_interval_is_that_of_the_known_distribution():
    """Differences of independent drives with a standard deviation of one: ±1.96/√N."""
    random = np.random.default_rng(1)
    base = np.stack([np.zeros(400), np.ones(400)], axis=1)
    run = np.stack([random.normal(0.3, 1.0, 400), np.ones(400)], axis=1)
    interval = difference_interval(base, run)
    assert interval is not None
    assert interval.high - interval.low == pytest.approx(2 * 1.96 / 20, rel=0.15)
    assert interval.low < 0.3 < interval.high


RULES = """
rules:
  - score: late_leads
    worse_by_at_most: 1.0
  - score: labelled.lead_missed
    worse_by_at_most: 2.0
  - event: first_acquisition
    at_least: 1
  - event: brake
    more_by_at_most: 100
"""


def _cipv(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


def test_the_gate_lets_a_run_pass_and_refuses_a_blind_one(
    runs: tuple[Path, str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out, sane, blind = runs
    rules, report = tmp_path / "rules.yaml", tmp_path / "report.html"
    rules.write_text(RULES, encoding="utf-8")
    typed = ("compare", "--out", out, "--gate", rules, "--json")
    assert _cipv(*typed, "--base", sane, "--run", blind) == 1
    said = capsys.readouterr()
    assert "FAILED: labelled.lead_missed: " in said.err
    figures = json.loads(said.out)
    assert figures["scores"]["labelled.lead_missed"]["verdict"] == "worse"
    assert len(figures["broken"]) == said.err.count("FAILED")
    assert figures["changes"][0]["link"].startswith("http")
    assert {each.split()[0] for each in figures["differences"]} == BLIND.keys()
    assert _cipv(*typed, "--base", blind, "--run", sane, "--report", report) == 0
    assert "Largest changes" in report.read_text(encoding="utf-8")


WRONG_RULES = {
    "no such score": "rules: [{score: jiter, at_most: 1}]",
    "no such event": "rules: [{event: cut_inn, at_most: 1}]",
    "no limit": "rules: [{score: jitter}]",
    "nothing": "rules: [{at_most: 1}]",
    "a setting that is none": "rules: []\nspeed: 3",
    "the other's limit": "rules: [{score: jitter, more_by_at_most: 1}]",
    "no mapping": "- 1",
}


@pytest.mark.parametrize("text", WRONG_RULES.values(), ids=WRONG_RULES)
def test_a_wrong_rule_is_refused_in_one_line(tmp_path: Path, text: str):
    file = tmp_path / "rules.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput) as refused:
        read_rules(file)
    assert str(refused.value).startswith(str(file))
    assert "\n" not in str(refused.value)


def test_rules_fail_where_nothing_can_be_said(tmp_path: Path):
    file = tmp_path / "rules.yaml"
    file.write_text("rules: [{score: jitter, at_most: 1}]\ndrives_at_least: 3", encoding="utf-8")
    said = broken(read_rules(file), [], [], drives=2, aside=1)
    assert said == [
        "2 drives are in both runs; at least 3 are required",
        "1 more recordings were set aside; at most 0 may be",
        "jitter: no drive has this score in both runs",
    ]


def test_cipv_compare_says_what_is_wrong_in_one_line(
    runs: tuple[Path, str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out, sane, blind = runs
    for typed in (("--base", "nothing"), ("--base", blind), ("--base", sane, "--gate", "none.yaml")):
        assert _cipv("compare", "--out", out, "--report", tmp_path / "report.html", *typed) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []  # no empty report
