"""Who the true lead is, and what the verdicts count."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.evaluation.experiments.choosing import (
    MAX_M,
    SENSORS,
    UNDECIDABLE,
    Case,
    Frame,
    InSight,
    Verdict,
    Way,
    acquired_m,
    replay,
    report,
    run,
    true_lead,
)
from pipeline.evaluation.experiments.sections import as_json
from pipeline.evaluation.lead import switches
from pipeline.simulation import scenario, world
from pipeline.simulation.camera import calibration
from tests.pipeline.evaluation.experiments.conftest import SeeAgain
from tests.pipeline.simulation.worlds import with_actors


@pytest.mark.parametrize(("verdict", "fails"), [("correct", False), ("missed", True), ("new", False)])
def test_one_wrong_frame_of_the_fused_fails_the_suite(verdict: Verdict, fails: bool) -> None:
    cases = [Case("straight", sensors, 0) for sensors in SENSORS]
    good, other = Frame(0.0, "correct", 1, 20.0, 1, 20.0), Frame(0.1, verdict, 1, 20.0, None, None)
    section = report(cases, [[good], [good], [good, other]])
    assert bool(section.failures) is fails
    assert not report(cases, [[good, other], [good], [good]]).failures, "it is the fused line that is judged"


def test_every_decidable_frame_is_right(see_again: SeeAgain) -> None:
    """One drive of the suite's twenty: the one in which a false alarm beside the lead once took its box."""
    case = Case("straight", "both", 8)
    frames = run(case)
    judged = [frame.verdict for frame in frames if frame.verdict not in UNDECIDABLE]
    assert len(judged) > 50
    assert set(judged) <= {"correct", "none"}
    again = see_again(replay(case, frames), 40)
    near = [result.cipv.id if result.cipv and result.cipv.distance_m <= MAX_M else None for result in again]
    assert near == [frame.chosen for frame in frames[:40]], "seen again, it chooses the same"


def lead_of(actors: str, segments: str = "{length_m: 2000}") -> int | None:
    scene = with_actors(actors, segments)
    now = world.at(scene, 0.0)
    lead, doubtful = true_lead(now, Way.of(scene).ahead(now))
    assert not doubtful
    return lead.actor.id if lead is not None else None


@pytest.mark.parametrize(
    ("actors", "lead"),
    [
        pytest.param("", None, id="nobody"),
        pytest.param("{id: 1, kind: car, lane: -2, ahead_m: 40, speed_mps: {0: 20}}", 1, id="ahead"),
        pytest.param("{id: 1, kind: car, lane: -1, ahead_m: 40, speed_mps: {0: 20}}", None, id="in the next lane"),
        pytest.param("{id: 1, kind: car, lane: -2, ahead_m: -20, speed_mps: {0: 20}}", None, id="behind"),
        pytest.param("{id: 1, kind: car, lane: -2, ahead_m: 70, speed_mps: {0: 20}}", None, id="beyond 60 m"),
        pytest.param(
            "{id: 1, kind: car, lane: -2, ahead_m: 50, speed_mps: {0: 9}},"
            "{id: 2, kind: car, lane: -2, ahead_m: 20, speed_mps: {0: 9}}",
            2,
            id="the nearer of two",
        ),
    ],
)
def test_the_true_lead(actors: str, lead: int | None) -> None:
    assert lead_of(actors) == lead


def test_in_a_curve_the_lead_is_on_the_way_driven_not_straight_ahead() -> None:
    bend = "{length_m: 100}, {length_m: 300, radius_m: 50}"
    assert lead_of("{id: 1, kind: car, lane: -2, ahead_m: 45, speed_mps: {0: 20}}", bend) == 1
    scene = with_actors("{id: 1, kind: car, lane: -2, ahead_m: 45, speed_mps: {0: 20}}", bend)
    now = world.at(scene, 0.0)
    assert now.actors[0].cuboid.center[1] > 5.0, "it stands well to the left of straight ahead"
    path = Way.of(scene).ahead(now)
    assert path is not None
    assert np.hypot(*np.diff(path.center, axis=0).T).sum() == pytest.approx(90.0, abs=6.0)


def test_one_at_the_edge_is_doubtful() -> None:
    scene = with_actors("{id: 1, kind: car, lane: -2, offset_m: 1.5, ahead_m: 30, speed_mps: {0: 20}}")
    now = world.at(scene, 0.0)
    assert true_lead(now, Way.of(scene).ahead(now))[1]


def test_what_has_just_come_into_sight_cannot_be_confirmed_yet() -> None:
    """A car behind another one is hidden, and in sight from when that one has moved over."""
    scene = with_actors(
        "{id: 1, kind: car, lane: -2, ahead_m: 50, speed_mps: {0: 20}},"
        "{id: 2, kind: truck, lane: -2, ahead_m: 15, speed_mps: {0: 20}, "
        "lane_changes: [{start_s: 0.5, duration_s: 2, lane: -1}]}"
    )
    camera, in_sight, hidden, confirmable = calibration(), InSight(), [], []
    for k in range(40):
        now = world.at(scene, k / 10)
        in_sight = in_sight.then(now, camera)
        hidden.append(in_sight.is_hidden(1))
        confirmable.append(in_sight.is_confirmable(1))
    first = hidden.index(False)
    assert 5 < first < 35
    assert confirmable == [False] * (first + 2) + [True] * (38 - first)


def frame(verdict: str, lead: int | None, chosen: int | None, lead_m: float = 30.0) -> Frame:
    return Frame(0.0, verdict, lead, lead_m if lead else None, chosen, lead_m if chosen else None)  # type: ignore[arg-type]


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
    assert "straight" in scenario.names()
    cases = [Case("straight", sensors, 0) for sensors in ("lidar", "both")]
    runs = [run(case) for case in cases]
    table = as_json(report(cases, runs))["tables"][0]
    rows = {row[1]: row for row in table["rows"]}
    assert rows["fused"][3] > 90.0
    assert rows["fused"][3] > rows["LiDAR"][3] + 10.0
    assert rows["LiDAR"][4] > rows["fused"][4]
