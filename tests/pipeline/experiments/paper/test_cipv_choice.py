"""What the verdicts count, and what real drives come to."""

from __future__ import annotations

import pytest

from pipeline.evaluation.lead_verdict import switches
from pipeline.evaluation.report_sections import as_json
from pipeline.experiments.paper.cipv_choice import (
    UNDECIDABLE,
    ChoiceCase,
    ChoiceFrame,
    ChoiceVerdict,
    acquired_m,
    as_drive,
    report,
    run,
)
from pipeline.experiments.perception import SENSORS
from pipeline.experiments.true_lead import MAX_M
from pipeline.simulation import built_in
from tests.pipeline.experiments.conftest import SeeAgain


@pytest.mark.parametrize(("verdict", "fails"), [("correct", False), ("missed", True), ("new", False)])
def test_one_wrong_frame_of_the_fused_fails_the_suite(verdict: ChoiceVerdict, fails: bool) -> None:
    cases = [ChoiceCase("straight", sensors, 0) for sensors in SENSORS]
    good, other = ChoiceFrame(0.0, "correct", 1, 20.0, 1, 20.0), ChoiceFrame(0.1, verdict, 1, 20.0, None, None)
    section = report(cases, [[good], [good], [good, other]])
    assert bool(section.failures) is fails
    assert not report(cases, [[good, other], [good], [good]]).failures, "it is the fused line that is judged"


def test_every_decidable_frame_is_right(see_again: SeeAgain) -> None:
    """One of the suite's twenty drives, in which a false alarm beside the lead once took its box."""
    case = ChoiceCase("straight", "both", 8)
    frames = run(case)
    judged = [frame.verdict for frame in frames if frame.verdict not in UNDECIDABLE]
    assert len(judged) > 50
    assert set(judged) <= {"correct", "none"}
    again = see_again(as_drive(case, frames), 40)
    near = [result.cipv.id if result.cipv and result.cipv.distance_m <= MAX_M else None for result in again]
    assert near == [frame.chosen for frame in frames[:40]], "seen again, it chooses the same"


def frame(verdict: str, lead: int | None, chosen: int | None, lead_m: float = 30.0) -> ChoiceFrame:
    return ChoiceFrame(0.0, verdict, lead, lead_m if lead else None, chosen, lead_m if chosen else None)  # type: ignore[arg-type]


def test_switches_and_first_acquisition() -> None:
    frames = [
        frame("missed", 1, None, 50.0),
        frame("correct", 1, 7, 45.0),
        frame("correct", 1, 7, 40.0),
        frame("wrong", 1, 8),
        frame("correct", 1, 7),
        frame("correct", 2, 9, 20.0),
        frame("none", None, None),
    ]
    assert switches((frame.lead, frame.chosen) for frame in frames) == 2, "7 → 8 → 7; a new lead is no switch"
    assert acquired_m(frames) == [45.0, 20.0]


def test_on_a_straight_road_fused_sees_more_than_the_lidar() -> None:
    assert "straight" in built_in.names()
    cases = [ChoiceCase("straight", sensors, 0) for sensors in ("lidar", "both")]
    runs = [run(case) for case in cases]
    table = as_json(report(cases, runs))["tables"][0]
    rows = {row[1]: row for row in table["rows"]}
    assert rows["fused"][3] > 90.0
    assert rows["fused"][3] > rows["LiDAR"][3] + 10.0
    assert rows["LiDAR"][4] > rows["fused"][4]
