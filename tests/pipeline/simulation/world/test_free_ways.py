"""Road users on ways of their own: pedestrians who cross, bicycles that turn."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from pipeline.evaluation.lead_verdict import LeadRule, true_lead
from pipeline.simulation import scenario
from pipeline.simulation.scenario import Scenario, ScenarioError
from pipeline.simulation.world import world_state
from pipeline.simulation.world.roadside import Roadside
from pipeline.sources.simulated import truth_of

CROSSES = "{id: 1, kind: pedestrian, s_m: 130, d_m: -5, heading_deg: 90, speed_mps: {0: 0, 2: 0, 2.001: 1.5}}"


def scene(actors: str, segments: str = "{length_m: 2000}", more: str = "") -> Scenario:
    return scenario.parse(
        f"""
title: test
duration_s: 10
road: {{segments: [{segments}], lanes_forward: 1, lanes_oncoming: 1, median_m: 0, lane_width_m: 3.5}}
ego: {{lane: -1, speed_mps: {{0: 0}}}}
free_actors: [{actors}]
{more}
""",
        "test.yaml",
    )


def test_a_pedestrian_waits_and_then_crosses_from_the_right() -> None:
    made = scene(CROSSES)
    states = [world_state.at(made, t_s).actors[0] for t_s in (0.0, 2.0, 4.0)]
    assert [state.cuboid.center[:2] for state in states] == [
        pytest.approx(place, abs=2e-3) for place in ((30.0, -3.25), (30.0, -3.25), (30.0, -0.25))
    ]
    assert all(state.cuboid.yaw_rad == pytest.approx(pi / 2) for state in states)
    assert [state.speed_mps for state in states] == pytest.approx([0.0, 0.0, 1.5])


def test_its_place_and_direction_are_relative_to_a_bending_road() -> None:
    made = scene(CROSSES, segments="{length_m: 130, radius_m: 200}, {length_m: 500}")
    state = world_state.at(made, 4.0).actors[0]
    x, y, heading = made.road.to_world(130.0, -2.0)[0].tolist()
    np.testing.assert_allclose(
        world_state.at(made, 4.0).to_ego(np.array([[x, y]]))[0], state.cuboid.center[:2], atol=2e-3
    )
    own_heading = world_state.at(made, 4.0).pose[2]
    assert state.cuboid.yaw_rad == pytest.approx(heading + pi / 2 - own_heading)


def test_a_way_of_pieces_bends_and_continues_as_its_last_piece() -> None:
    way = "[{length_m: 10}, {length_m: 7.853981634, curvature_per_m: 0.2}, {length_m: 1}]"
    made = scene(f"{{id: 1, kind: bicycle, s_m: 120, d_m: 0, way: {way}, speed_mps: {{0: 5}}}}")
    (start,), (bend,), (end,) = (world_state.at(made, t_s).actors for t_s in (0.0, 3.0, 5.0))
    assert start.yaw_rate_radps == end.yaw_rate_radps == 0.0
    assert bend.yaw_rate_radps == pytest.approx(1.0)
    assert end.cuboid.yaw_rad == pytest.approx(pi / 2)
    left_m = 5.0 + (25.0 - 10.0 - 2.5 * pi)
    assert end.cuboid.center[:2] == pytest.approx((20.0 + 10.0 + 5.0, 1.75 + left_m))


def test_labels_are_named_as_those_of_real_recordings_and_are_no_lead() -> None:
    """In KITTI and Astyx, too, pedestrians and cyclists are labelled but never the lead."""
    kinds = ("pedestrian", "bicycle", "motorcycle")
    actors = [
        f"{{id: {n + 1}, kind: {kind}, s_m: {110 + 10 * n}, d_m: -1.75, speed_mps: {{0: 1}}}}"
        for n, kind in enumerate(kinds)
    ]
    made = scene(", ".join(actors))
    truth = truth_of(world_state.at(made, 0.0), made.road)
    assert [item.label for item in truth] == ["person", "bicycle", "motorcycle"]
    lead = true_lead(truth, LeadRule())
    assert lead is not None
    assert lead.label == "motorcycle"


@pytest.mark.parametrize(
    ("actors", "more", "says"),
    [
        (
            CROSSES,
            "actors: [{id: 1, kind: car, lane: -1, ahead_m: 9, speed_mps: {0: 1}}]",
            "two actors have the same id",
        ),
        (CROSSES.replace("speed_mps", "brake: {at_gap_m: 5, decel_mps2: 1}, speed_mps"), "", "give at_s"),
        (CROSSES.replace("heading_deg: 90", "way: [{length_m: 0}]"), "", "greater than 0"),
    ],
)
def test_a_wrong_one_is_told_in_one_sentence(actors: str, more: str, says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        scene(actors, more=more)


def test_nothing_stands_where_they_go() -> None:
    """Trees and buildings stand at random beside the road, but not on the way of a car from the right."""
    way = "[{length_m: 60}, {length_m: 15.7, curvature_per_m: 0.1}]"
    made = scene(f"{{id: 1, kind: car, s_m: 180, d_m: -60, heading_deg: 90, way: {way}, speed_mps: {{0: 15}}}}")
    kept = Roadside.build(made.road, 0, 0.0, 900.0, made.kept_clear)
    usual = Roadside.build(made.road, 0, 0.0, 900.0)

    def nearest_m(roadside: Roadside) -> float:
        there = made.free_ways[0].to_world(np.arange(0.0, 150.0, 0.5), 0.0)
        apart = np.hypot(roadside.poses[:, :1] - there[:, 0], roadside.poses[:, 1:2] - there[:, 1]).min(axis=1)
        return float(min(apart - [max(thing.length_m, thing.width_m) / 2 for thing in roadside.things]))

    assert nearest_m(usual) < 0.5
    assert nearest_m(kept) > 1.5
    assert set(kept.things) < set(usual.things)
    assert scene("").kept_clear is None
