"""Who is where, seen from the ego vehicle."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.simulation.world import world_state
from pipeline.simulation.world.actors import Motion
from tests.pipeline.simulation.worlds import with_actors


def only(actors: str, **road: object) -> world_state.ActorState:
    return world_state.at(with_actors(actors, **road), 0.0).actors[0]  # type: ignore[arg-type]


def test_ahead_is_to_the_nearest_face() -> None:
    rear = only("{id: 1, kind: car, lane: -2, ahead_m: 30, speed_mps: {0: 20}}").cuboid
    assert rear.center[0] - rear.size[0] / 2 == pytest.approx(30.0)
    assert rear.center[1] == pytest.approx(0.0)
    assert rear.center[2] - rear.size[2] / 2 == pytest.approx(-world_state.LIDAR_HEIGHT_M), "it stands on the road"
    behind = only("{id: 1, kind: car, lane: -2, ahead_m: -20, speed_mps: {0: 20}}").cuboid
    assert behind.center[0] + behind.size[0] / 2 == pytest.approx(-20.0)


def test_left_is_left_and_oncoming_comes() -> None:
    left = only("{id: 1, kind: car, lane: -1, ahead_m: 30, speed_mps: {0: 20}}").cuboid
    assert left.center[1] == pytest.approx(3.6)
    scene = with_actors("{id: 1, kind: car, lane: 1, ahead_m: 100, speed_mps: {0: 25}}")
    before, after = (world_state.at(scene, t).actors[0].cuboid for t in (0.0, 1.0))
    assert before.center[1] == pytest.approx(3.6 / 2 + 3.6 + 4.0 + 3.6 / 2)
    assert before.center[0] - after.center[0] == pytest.approx(45.0), "20 m/s towards 25 m/s"
    assert abs(before.yaw_rad) == pytest.approx(np.pi)


@pytest.mark.parametrize(("curvature", "sign"), [(0.005, 1.0), (-0.005, -1.0)])
def test_a_left_curve_turns_left(curvature: float, sign: float) -> None:
    segments = f"{{length_m: 5000, curvature_per_m: {curvature}}}"
    scene = with_actors("{id: 1, kind: car, lane: -2, ahead_m: 40, speed_mps: {0: 20}}", segments=segments)
    now = world_state.at(scene, 2.0)
    assert np.sign(now.yaw_rate_radps) == sign
    d = scene.road.lane_offset_m(-2)
    assert now.yaw_rate_radps == pytest.approx(20.0 * curvature / (1 - curvature * d))
    lead = now.actors[0].cuboid
    assert np.sign(lead.center[1]) == sign
    assert np.sign(lead.yaw_rad) == sign


def test_the_yaw_rate_is_what_the_heading_does() -> None:
    """In a lane change, the derivative of the heading is the yaw rate in the frame."""
    scene = with_actors()
    change = {"start_s": 1.0, "duration_s": 4.0, "lane": -1}
    ego = scene.ego.model_validate({**scene.ego.model_dump(), "lane_changes": [change]})
    scene = scene.model_validate({**scene.model_dump(), "ego": ego.model_dump()})
    for t in (1.5, 2.2, 3.5):
        turned = world_state.at(scene, t + 0.01).pose[2] - world_state.at(scene, t - 0.01).pose[2]
        assert turned / 0.02 == pytest.approx(world_state.at(scene, t).yaw_rate_radps, rel=0.03)


def test_to_ego_undoes_the_pose() -> None:
    now = world_state.at(with_actors(segments="{length_m: 900, curvature_per_m: 0.01}"), 3.0)
    x, y, heading = now.pose
    ahead_left = np.array(
        [[x + 5 * np.cos(heading) - 2 * np.sin(heading), y + 5 * np.sin(heading) + 2 * np.cos(heading)]]
    )
    np.testing.assert_allclose(now.to_ego(ahead_left), [[5.0, 2.0]], atol=1e-9)


def test_a_given_ego_motion_replaces_the_script_and_leaves_the_others_to_theirs() -> None:
    scene = with_actors("{id: 1, kind: car, lane: -2, ahead_m: 30, speed_mps: {0: 20}}")
    scripted = world_state.at(scene, 2.0)
    braked = world_state.at(scene, 2.0, Motion(30.0, scene.road.lane_offset_m(-2), 10.0, -5.0, 0.0, 0.0))
    assert scripted.s_m - braked.s_m == pytest.approx(10.0)
    assert braked.speed_mps == 10.0
    assert braked.actors[0].cuboid.center[0] - scripted.actors[0].cuboid.center[0] == pytest.approx(10.0)
    assert braked.actors[0].speed_mps == 20.0


def test_braking_at_a_gap_starts_when_the_gap_is_that() -> None:
    lead = "{id: 1, kind: car, lane: -2, ahead_m: 50, speed_mps: {0: 15}, brake: {at_gap_m: 40, decel_mps2: 6}}"
    scene = with_actors(lead)
    gaps = {}
    for t in np.arange(1.5, 2.6, 0.01):
        lead_now = world_state.at(scene, float(t)).actors[0]
        gaps[round(float(t), 2)] = (lead_now.cuboid.center[0] - lead_now.cuboid.size[0] / 2, lead_now.speed_mps)
    assert gaps[1.99][1] == 15.0
    assert gaps[2.0][0] == pytest.approx(40.0, abs=0.1)  # 20 m/s onto 15 m/s: 10 m nearer after 2 s
    assert gaps[2.5][1] == pytest.approx(12.0, abs=0.1)


@pytest.mark.parametrize("lane", [-1, -3])
def test_ground_covered_is_the_speed_in_a_bend_too(lane: int) -> None:
    """On the inner lane of a bend, a car at 20 m/s covers 20 m of its lane per second."""
    scene = with_actors(segments="{length_m: 900, radius_m: 60}", lane=lane)
    here, there = world_state.at(scene, 3.0), world_state.at(scene, 3.01)
    assert np.hypot(there.pose[0] - here.pose[0], there.pose[1] - here.pose[1]) == pytest.approx(0.2, rel=1e-4)
    assert here.speed_mps == 20.0


def test_an_actors_yaw_rate_is_what_its_heading_does() -> None:
    changing = "lane_changes: [{start_s: 0, duration_s: 4, lane: -2}]"
    along = f"{{id: 1, kind: car, lane: -1, ahead_m: 20, speed_mps: {{0: 20}}, {changing}}}"
    actors = along + ", {id: 2, kind: car, lane: 1, ahead_m: 90, speed_mps: {0: 15}}"
    scene = with_actors(actors, segments="{length_m: 900, radius_m: 100}")

    def headings(t_s: float) -> dict[int, float]:
        now = world_state.at(scene, t_s)
        return {state.actor.id: state.cuboid.yaw_rad + now.pose[2] for state in now.actors}

    before, after = headings(1.0), headings(1.02)
    for state in world_state.at(scene, 1.01).actors:
        turned = np.remainder(after[state.actor.id] - before[state.actor.id] + np.pi, 2 * np.pi) - np.pi
        assert turned / 0.02 == pytest.approx(state.yaw_rate_radps, rel=0.03)


def test_a_lane_change_at_standstill_does_not_turn_on_the_spot() -> None:
    change = "lane_changes: [{start_s: 0, duration_s: 4, lane: -1}]"
    scene = with_actors(f"{{id: 1, kind: car, lane: -2, ahead_m: 30, speed_mps: {{0: 0}}, {change}}}")
    assert abs(world_state.at(scene, 2.0).actors[0].cuboid.yaw_rad) < 0.8
