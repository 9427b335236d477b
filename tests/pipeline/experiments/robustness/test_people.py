"""People beside the streets of the random traffic: where they are, and that they do not change the rest of it."""

from __future__ import annotations

from math import dist

import numpy as np
import pytest

from pipeline.experiments.robustness import people, road_kinds, traffic
from pipeline.experiments.robustness.true_vehicles import what
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.world import world_state

SEED = 21
STREETS = [n for n in range(40) if road_kinds.layout_of(SEED, n)[0].parked][:6]


def from_the_middle_m(scene: Scenario, t_s: float) -> dict[int, float]:
    """By id, the distance of each person from the road's reference line."""
    middle = scene.road.to_world(np.arange(0.0, 1400.0, 0.5), 0.0)[:, :2]
    found = {}
    for actor, way in zip(scene.free_actors, scene.free_ways, strict=True):
        place = way.to_world(actor.travelled_m(t_s), 0.0)[0, :2]
        found[actor.id] = float(np.hypot(*(middle - place).T).min())
    return found


@pytest.mark.parametrize("number", STREETS)
def test_nobody_enters_the_lanes(number: int) -> None:
    scene = traffic.scenario(SEED, number)
    road = scene.road
    narrower_m = min(road.lanes_forward, road.lanes_oncoming) * road.lane_width_m
    assert len(scene.free_actors) > 20
    for t_s in np.arange(0.0, scene.duration_s, 2.5).tolist():
        assert min(from_the_middle_m(scene, t_s).values()) > narrower_m + 0.2


def test_some_come_to_the_kerb_and_wait_there_while_the_car_passes() -> None:
    waited = 0
    for number in STREETS[:3]:
        scene = traffic.scenario(SEED, number)
        right_m = scene.road.lanes_forward * scene.road.lane_width_m
        times_s = np.arange(0.0, scene.duration_s, 0.5)
        ahead_m = [world_state.at(scene.without_others(), t_s).s_m for t_s in times_s.tolist()]
        for actor in scene.free_actors:
            if actor.d_m < 0.0 and abs(actor.heading_deg) == 90.0 and actor.s_m < ahead_m[-1]:
                passes_s = float(np.interp(actor.s_m, ahead_m, times_s))
                walked_m = actor.travelled_m(passes_s + 0.5)
                assert walked_m == pytest.approx(actor.travelled_m(passes_s + 5.0), abs=1e-6) != 0.0
                assert -actor.d_m - walked_m - right_m == pytest.approx(0.6, abs=0.31)
                waited += 1
    assert waited >= 5


@pytest.mark.parametrize("number", STREETS[:3])
def test_nobody_waits_inside_a_parked_car(number: int) -> None:
    scene = traffic.scenario(SEED, number)
    now = world_state.at(scene, 20.0)
    people_m = [state.cuboid.center[:2] for state in now.actors if state.actor.kind == "pedestrian"]
    parked = [state for state in now.actors if 100 <= state.actor.id < 1000]
    assert parked
    for state in parked:
        assert all(dist(state.cuboid.center[:2], place) > 1.0 for place in people_m)


def test_only_streets_have_people() -> None:
    for number in range(12):
        has_people = bool(traffic.scenario(SEED, number).free_actors)
        assert has_people == road_kinds.layout_of(SEED, number)[0].parked


def test_the_rest_of_the_traffic_does_not_depend_on_them(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = traffic.scenario(SEED, STREETS[0])
    monkeypatch.setattr(traffic, "people", lambda *_: iter(()))
    assert traffic.scenario(SEED, STREETS[0]) == whole.model_copy(update={"free_actors": ()})


def test_a_failure_because_of_a_person_is_counted_as_such() -> None:
    scene = traffic.scenario(SEED, STREETS[0])
    person = next(s for s in world_state.at(scene, 0.0).actors if s.actor.id >= people.FIRST_ID)
    assert what([person]) == "pedestrian"
