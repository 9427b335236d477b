"""Cases may be driven by several processes; the report is the same."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from pipeline.evaluation.report_sections import Chart, Coloured, ReportSection, Series, Table, as_json
from pipeline.experiments.experiment import Experiment, ExperimentDrive
from pipeline.experiments.runner import EXPERIMENTS, SUITES, NoSuchSuite, count_cases, of_suite, run_all
from pipeline.params import Params
from pipeline.simulation.scenario import Ego, Scenario
from pipeline.simulation.world.roads import Road


def _cases(short: bool) -> list[int]:
    return list(range(3 if short else 12))


def _square(case: int) -> int:
    return case * case


def _report(cases: Sequence[int], outcomes: Sequence[int]) -> ReportSection:
    return ReportSection("squares", "Squares", (), (Table("t", ("n", "n²"), tuple(zip(cases, outcomes, strict=True))),))


def _replay(case: int, outcome: int) -> ExperimentDrive:
    road = Road.model_validate({"segments": [{"length_m": 100.0}]})
    scenario = Scenario(title="a drive", duration_s=1.0, road=road, ego=Ego(lane=-1, speed_mps={0.0: 5.0}))
    return ExperimentDrive(f"square_{case}", f"{case}²", (str(outcome),), scenario, Params(), "both", ())


SQUARES = Experiment("squares", "paper", "Squares", _cases, _square, _report, _replay)


def test_the_order_of_the_cases_is_kept_and_each_is_counted() -> None:
    done: list[None] = []
    alone = run_all([SQUARES], jobs=1, done=lambda: done.append(None))
    assert alone[0].tables[0].rows == tuple((n, n * n) for n in range(12))
    assert len(done) == count_cases([SQUARES], short=False) == 12


def test_in_processes_as_alone() -> None:
    ranging = of_suite("regression")
    assert run_all(ranging, short=True, jobs=2) == run_all(ranging, short=True, jobs=1)


@pytest.mark.parametrize("suite", SUITES)
def test_every_suite_has_experiments(suite: str) -> None:
    assert of_suite(suite)
    assert set(of_suite(suite)) <= set(EXPERIMENTS)


def test_every_drive_of_an_experiment_is_kept() -> None:
    kept: list[tuple[str, ExperimentDrive]] = []
    run_all(of_suite("regression"), short=True, jobs=1, keep=lambda each, as_drive: kept.append((each.name, as_drive)))
    assert len({driven.name for _, driven in kept}) == count_cases(of_suite("regression"), short=True)
    assert {name for name, _ in kept} == {"regression"}


def test_one_experiment_by_name_and_none_by_a_wrong_one() -> None:
    assert [each.name for each in of_suite("braking")] == ["braking"]
    with pytest.raises(NoSuchSuite, match="'bracing'") as error:
        of_suite("bracing")
    assert str(error.value).count("iso") == 1, "a suite and an experiment of one name are named once"


def test_every_experiment_has_a_short_form_that_is_part_of_the_long_one() -> None:
    for each in EXPERIMENTS:
        assert 0 < len(each.cases(True)) < len(each.cases(False))
        assert set(each.cases(True)) <= set(each.cases(False)), each.name


def test_as_json_keeps_colours_and_lines() -> None:
    table = Table("t", ("a",), ((Coloured(3.0, "red"),), (None,)))
    section = ReportSection("s", "S", ("text",), (table,), (Chart("c", "x", "y", (Series("l", (1.0,), (2.0,)),)),))
    data = as_json(section)
    assert data["tables"][0]["rows"] == [[{"value": 3.0, "tone": "red"}], [None]]
    assert data["charts"][0]["series"] == [{"name": "l", "x": [1.0], "y": [2.0]}]
