"""The CIPV in curves: what the verdicts count, and one short drive of each kind."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.fast_replace import evolve
from pipeline.experiments.curves import experiment, scenarios
from pipeline.experiments.curves.drives import SOURCES, SourceFrames, seen
from pipeline.experiments.curves.experiment import (
    CurveCase,
    CurveOutcome,
    longest_wrong_s,
    share_right,
    told_before_line_s,
)
from pipeline.simulation.sensors.senses import Senses
from pipeline.simulation.world import world_state


def drive(
    *verdicts: str, lead_m: float = 30.0, told: tuple[bool, ...] = (), over_line_s: float | None = None
) -> SourceFrames:
    count = len(verdicts)
    times = tuple(k / 10 for k in range(count))
    known = tuple(lead_m if verdict in ("right", "missed", "decoy") else None for verdict in verdicts)
    rows = ((0.0,) * 4,) * count
    return SourceFrames(times, verdicts, known, told or (False,) * count, rows, rows, over_line_s)  # type: ignore[arg-type]


def test_what_counts_as_right() -> None:
    near, far = drive("right", "right", "missed", "undecided"), drive("right", "decoy", "none", "false", lead_m=80.0)
    assert share_right([near]) == (pytest.approx(2 / 3), 3)
    assert share_right([near, far], 60.0) == (pytest.approx(3 / 5), 5)
    assert share_right([near, far]) == (pytest.approx(4 / 7), 7)


def test_the_longest_time_on_a_decoy() -> None:
    assert longest_wrong_s(drive("right", "decoy", "decoy", "false", "right", "decoy")) == pytest.approx(0.3)
    assert longest_wrong_s(drive("right", "missed", "undecided")) == 0.0


def test_told_before_the_wheel_is_over_the_line() -> None:
    told = (False, True, False, True, True, True)
    assert told_before_line_s(drive(*["right"] * 6, told=told, over_line_s=0.45)) == pytest.approx(0.15)
    assert told_before_line_s(drive(*["right"] * 6, told=(True,) * 5 + (False,), over_line_s=0.45)) is None


@pytest.mark.parametrize(
    ("told", "fails"),
    [((False, True, True, True), False), ((False, False, False, True), True), ((False,) * 4, True)],
    ids=["before", "after", "never"],
)
def test_a_cut_in_that_is_told_too_late_is_a_demand_that_fails(told: tuple[bool, ...], fails: bool) -> None:
    case = CurveCase("cut_in", "straight", 0)
    cut_in = {"fused": drive(*["right"] * 4, told=told, over_line_s=0.2)}
    assert bool(experiment.report([case], [cut_in]).failures) is fails


@pytest.mark.parametrize("layout", scenarios.LAYOUTS.values(), ids=lambda layout: layout.name)
def test_the_roads_bend_as_hard_as_said(layout: scenarios.CurveLayout) -> None:
    scene = scenarios.scenario(layout, 0)
    hardest = max(abs(now.speed_mps * now.yaw_rate_radps) for now in (world_state.at(scene, t / 5) for t in range(60)))
    assert hardest == pytest.approx(0.0 if layout.radius_m is None else 3.0, abs=0.2)
    sides = {seed: scenarios.scenario(layout, seed).road.segments for seed in (0, 1)}
    assert layout.radius_m is None or sides[0] != sides[1], "to the left, and to the right"


@pytest.fixture(scope="module")
def outcomes() -> dict[CurveCase, CurveOutcome]:
    return {case: experiment.run(case) for case in experiment.cases(short=True)}


def test_in_a_bend_of_125_m_the_lead_is_the_cipv(outcomes: dict[CurveCase, CurveOutcome]) -> None:
    """With all sources fused: in 99 % of the frames up to 60 m, never 0.3 s on a decoy; a straight path shows the
    difference."""
    (outcome,) = (outcome for case, outcome in outcomes.items() if case.kind == "follow")
    share, frames = share_right([outcome["fused"]], 60.0)
    assert frames > 90
    assert share >= 0.99
    assert longest_wrong_s(outcome["fused"]) <= 0.3
    assert share_right([outcome["lane lines and yaw rate"]], 60.0)[0] >= 0.99, "without a route too"
    assert share_right([outcome["straight guess"]])[0] < 0.5
    assert share_right([outcome["yaw rate"]])[0] > share_right([outcome["straight guess"]])[0] + 0.3


def test_a_drive_seen_again_has_the_boxes_and_lines_that_it_had(outcomes: dict[CurveCase, CurveOutcome]) -> None:
    case, outcome = next((case, outcome) for case, outcome in outcomes.items() if case.kind == "follow")
    kept = experiment.as_drive(case, outcome)
    scene = kept.as_seen()
    _, driven = next(iter(seen(scene)))
    now = world_state.at(scene, 0.0)
    again = Senses(scene).sensed(evolve(driven, raw_boxes=None, raw_lanes=None), now)
    for ours, theirs in ((again.raw_boxes, driven.raw_boxes), (again.raw_lanes, driven.raw_lanes)):
        assert ours is not None
        assert theirs is not None
        np.testing.assert_array_equal(ours.scores, theirs.scores)
    assert len(kept.charts[0].series[0].x) > 90


def test_a_cut_in_is_told_before_the_wheel_is_over_the_line(outcomes: dict[CurveCase, CurveOutcome]) -> None:
    (outcome,) = (outcome for case, outcome in outcomes.items() if case.kind == "cut_in")
    before_s = told_before_line_s(outcome["fused"])
    assert before_s is not None
    assert before_s >= 0.0


def test_the_report_says_what_held(outcomes: dict[CurveCase, CurveOutcome]) -> None:
    section = experiment.report(list(outcomes), list(outcomes.values()))
    assert any(text.startswith("R = 125 m, 70 km/h: correct in ") for text in section.text)
    choice, path, cut_in = section.tables
    assert [row[1] for row in choice.rows] == list(SOURCES)
    errors = {row[1]: row[4] for row in path.rows}
    assert errors["fused"] < 0.3 < errors["straight guess"]  # type: ignore[operator]
    for source in ("road edges", "other vehicles"):
        assert errors[source] < 0.5 * errors["straight guess"]  # type: ignore[operator]
    assert len(section.scenes) == 1
    assert len(cut_in.rows) == 1
