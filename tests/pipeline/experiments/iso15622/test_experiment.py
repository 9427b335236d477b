"""What passes and what does not, and one real stop behind a braking lead."""

from __future__ import annotations

import pytest

from pipeline.common.fast_replace import evolve
from pipeline.evaluation.report_sections import Coloured
from pipeline.experiments.iso15622.experiment import (
    FollowingCase,
    FollowingOutcome,
    as_drive,
    cases,
    passed,
    report,
    run,
)
from tests.pipeline.experiments.conftest import SeeAgain

GOOD = FollowingOutcome(50.0, 1.0, 12.0, 1.4, False, (0.0, 0.1), (50.0, 49.0), (20.0, 20.0))


@pytest.mark.parametrize(
    ("changed", "good"),
    [
        pytest.param({}, True, id="all well"),
        pytest.param({"touched": True}, False, id="contact"),
        pytest.param({"kept": 0.9}, False, id="lost in a tenth of the frames"),
        pytest.param({"smallest_time_gap_s": 0.79}, False, id="too near for its speed"),
        pytest.param({"smallest_time_gap_s": None}, True, id="never drove"),
        pytest.param({"acquired_m": None, "kept": 0.0}, False, id="never found"),
    ],
)
def test_passing(changed: dict[str, object], good: bool) -> None:
    assert passed(evolve(GOOD, **changed)) is good


def test_it_stops_behind_a_lead_that_brakes_and_keeps_its_time_gap(see_again: SeeAgain) -> None:
    case = FollowingCase("stop", 50.0, "both", 0)
    outcome = run(case)
    assert passed(outcome)
    assert outcome.speed_mps[-1] == pytest.approx(0.0, abs=0.3)
    assert 2.0 < outcome.range_m[-1] < 8.0, "about d_min of 5 m"
    again = see_again(as_drive(case, outcome), 80)
    assert [result.ego is not None and result.ego.speed_mps for result in again] == pytest.approx(
        outcome.speed_mps[:80], abs=0.1
    ), "seen again, it brakes the same"
    leads = [(result.cipv.distance_m, m) for result, m in zip(again, outcome.range_m, strict=False) if result.cipv]
    assert len(leads) > 60
    assert all(abs(measured - true) < 0.15 * true for measured, true in leads)


def test_beside_is_not_ahead() -> None:
    """Cars to either side, nearer than the lead: the lead is chosen all the same."""
    outcome = run(FollowingCase("discrimination", 60.0, "both", 0))
    assert outcome.acquired_m is not None
    assert outcome.kept > 0.9


def test_the_tests_of_the_standard_are_there_and_the_report_names_the_failed() -> None:
    full = cases(False)
    assert {case.value for case in full if case.test == "curve"} == {500.0, 250.0, 125.0}
    pair = [FollowingCase("curve", 250.0, "lidar", 0), FollowingCase("curve", 250.0, "both", 0)]
    section = report(pair, [evolve(GOOD, touched=True), GOOD])
    assert "fused passes 1 of 1 runs, better than the LiDAR alone (0 of 1)" in section.text[2]
    assert [scene.title for scene in section.scenes] == ["Curve, R = 250 m"]
    last = [row[-1] for row in section.tables[0].rows]
    assert last == [
        Coloured("no", "red", "iso_curve_250_lidar_0"),
        Coloured("yes", "green", "iso_curve_250_fused_0"),
    ]
