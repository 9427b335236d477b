"""Ways over an intersection, in words: who comes from where, and where they go."""

from __future__ import annotations

from math import degrees

import numpy as np
import pytest
import yaml

from pipeline.simulation import scenario
from pipeline.simulation.scenario import Scenario, ScenarioError
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import ActorState

TOWN = {
    "segments": [{"length_m": 2000}],
    "crossings": [{"s_m": 300.0}],
    "lane_width_m": 3.5,
    "lanes_forward": 1,
    "lanes_oncoming": 1,
    "median_m": 0.0,
}


def crossed(angle_deg: float = 90.0, **actor: object) -> Scenario:
    """The ego vehicle stands 100 m before the crossing; one other vehicle reaches it at 10 s."""
    road = {**TOWN, "crossings": [{"s_m": 300.0, "angle_deg": angle_deg}]}
    one = {"id": 1, "kind": "car", "arrive_s": 10.0, "speed_mps": {0: 8.0}, **actor}
    ego = {"lane": -1, "speed_mps": {0: 0.0}, "start_m": 200.0}
    text = yaml.safe_dump({"title": "t", "duration_s": 20, "road": road, "ego": ego, "crossing_actors": [one]})
    return scenario.parse(text, "t.yaml")


def seen(scene: Scenario, t_s: float) -> ActorState:
    return world_state.at(scene, t_s).actors[0]


EGO_LANE_Y, OTHER_LANE_Y, CROSS_X = 0.0, 3.5, 100.0


@pytest.mark.parametrize(
    ("approach", "turn", "before", "after", "yaw_after_deg"),
    [
        ("oncoming", "left", (150.0, OTHER_LANE_Y), (CROSS_X - 1.75, -60.0), -90.0),
        ("oncoming", "right", (150.0, OTHER_LANE_Y), (CROSS_X + 1.75, 60.0), 90.0),
        ("oncoming", "straight", (150.0, OTHER_LANE_Y), (40.0, OTHER_LANE_Y), 180.0),
        ("left", "straight", (CROSS_X - 1.75, 55.0), (CROSS_X - 1.75, -55.0), -90.0),
        ("right", "straight", (CROSS_X + 1.75, -55.0), (CROSS_X + 1.75, 55.0), 90.0),
        ("right", "left", (CROSS_X + 1.75, -55.0), (50.0, OTHER_LANE_Y), 180.0),
        ("right", "right", (CROSS_X + 1.75, -55.0), (150.0, EGO_LANE_Y), 0.0),
        ("left", "left", (CROSS_X - 1.75, 55.0), (150.0, EGO_LANE_Y), 0.0),
        ("ahead", "right", (50.0, EGO_LANE_Y), (CROSS_X - 1.75, -60.0), -90.0),
        ("ahead", "left", (50.0, EGO_LANE_Y), (CROSS_X + 1.75, 60.0), 90.0),
    ],
)
def test_where_it_comes_from_and_goes(
    approach: str, turn: str, before: tuple[float, float], after: tuple[float, float], yaw_after_deg: float
) -> None:
    scene = crossed(approach=approach, turn=turn)
    first, last = seen(scene, 0.0).cuboid, seen(scene, 20.0).cuboid
    for place, (x, y), along_x in (
        (first.center, before, approach in ("ahead", "oncoming")),
        (last.center, after, abs(yaw_after_deg) != 90.0),
    ):
        kept = 1 if along_x else 0  # beside its direction it is in its lane; along it, far out on its arm
        assert place[kept] == pytest.approx((x, y)[kept], abs=1e-6)
        assert np.sign(place[1 - kept] - (CROSS_X, 0.0)[1 - kept]) == np.sign(
            (x, y)[1 - kept] - (CROSS_X, 0.0)[1 - kept]
        )
        assert abs(place[1 - kept] - (CROSS_X, 0.0)[1 - kept]) > 40.0
    turned = degrees(last.yaw_rad) - yaw_after_deg
    assert (turned + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("turn", ["left", "straight", "right"])
@pytest.mark.parametrize("angle_deg", [60.0, 90.0, 120.0])
@pytest.mark.parametrize("approach", ["oncoming", "left", "right", "ahead"])
def test_it_moves_as_it_points_and_at_its_speed(approach: str, turn: str, angle_deg: float) -> None:
    scene = crossed(angle_deg, approach=approach, turn=turn)
    for t in np.arange(7.0, 13.0, 0.25):
        here, soon = seen(scene, float(t)), seen(scene, float(t) + 0.01)
        moved = np.array(soon.cuboid.center[:2]) - here.cuboid.center[:2]
        middle_yaw = here.cuboid.yaw_rad + 0.005 * here.yaw_rate_radps
        assert np.hypot(*moved) == pytest.approx(0.08, rel=1e-3)
        assert moved @ (np.cos(middle_yaw), np.sin(middle_yaw)) == pytest.approx(0.08, rel=1e-3)


def test_at_its_time_it_is_halfway_round() -> None:
    scene = crossed(approach="oncoming", turn="left", radius_m=12.0)
    middle = seen(scene, 10.0).cuboid
    assert degrees(middle.yaw_rad) == pytest.approx(-135.0, abs=1e-6)
    assert np.hypot(middle.center[0] - CROSS_X, middle.center[1]) < 6.0
    assert seen(scene, 10.0).yaw_rate_radps == pytest.approx(8.0 / 12.0)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"crossing": 1}, "no crossing 1"),
        ({"lane": 2}, "no lane 2 for oncoming traffic"),
        ({"approach": "above"}, "crossing_actors.0.approach"),
        ({"brake": {"at_gap_m": 20, "decel_mps2": 3}}, "give at_s"),
    ],
)
def test_what_the_road_does_not_have_is_refused(change: dict[str, object], says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        crossed(90.0, **{"approach": "oncoming", **change})
