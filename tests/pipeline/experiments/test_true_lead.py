"""Who the true lead is, and since when it can be seen."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.experiments.true_lead import InSight, ScriptedWay, true_lead
from pipeline.simulation.sensors.camera import calibration
from pipeline.simulation.world import world_state
from tests.pipeline.simulation.worlds import with_actors


def lead_of(actors: str, segments: str = "{length_m: 2000}") -> int | None:
    scene = with_actors(actors, segments)
    now = world_state.at(scene, 0.0)
    lead, doubtful = true_lead(now, ScriptedWay.of(scene).ahead(now))
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
    now = world_state.at(scene, 0.0)
    assert now.actors[0].cuboid.center[1] > 5.0, "it stands well to the left of straight ahead"
    path = ScriptedWay.of(scene).ahead(now)
    assert path is not None
    assert np.hypot(*np.diff(path.center, axis=0).T).sum() == pytest.approx(90.0, abs=6.0)


def test_one_at_the_edge_is_doubtful() -> None:
    scene = with_actors("{id: 1, kind: car, lane: -2, offset_m: 1.5, ahead_m: 30, speed_mps: {0: 20}}")
    now = world_state.at(scene, 0.0)
    assert true_lead(now, ScriptedWay.of(scene).ahead(now))[1]


def test_what_has_just_come_into_sight_cannot_be_confirmed_yet() -> None:
    """A car is hidden behind another one until that one has changed lanes."""
    scene = with_actors(
        "{id: 1, kind: car, lane: -2, ahead_m: 50, speed_mps: {0: 20}},"
        "{id: 2, kind: truck, lane: -2, ahead_m: 15, speed_mps: {0: 20}, "
        "lane_changes: [{start_s: 0.5, duration_s: 2, lane: -1}]}"
    )
    camera, in_sight, hidden, confirmable = calibration(), InSight(), [], []
    for k in range(40):
        now = world_state.at(scene, k / 10)
        in_sight = in_sight.then(now, camera)
        hidden.append(in_sight.is_hidden(1))
        confirmable.append(in_sight.is_confirmable(1))
    first = hidden.index(False)
    assert 5 < first < 35
    assert confirmable == [False] * (first + 2) + [True] * (38 - first)
