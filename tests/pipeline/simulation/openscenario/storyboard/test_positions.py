"""Positions: each kind gives the same place, and what is not on the road is refused."""

from __future__ import annotations

from math import pi
from pathlib import Path

import pytest

from pipeline.simulation.scenario import Scenario, ScenarioError
from pipeline.simulation.world import world_state
from tests.pipeline.simulation.openscenario.files import Parts, entity, init, on_lane, xodr

FACING = '<Orientation type="{}" h="{}"/>'


def placed(folder: Path, position: str, road: str = "") -> Scenario:
    """The ego vehicle's reference point is at s = 100 on lane −1; both are 4 m long, with the middle 1.5 m ahead of the
    reference point."""
    parts = Parts(init=init("Ego", on_lane(-1, 100.0), "20") + init("Lead", position, "10"))
    parts.road = road or parts.road
    return parts.load(folder)


@pytest.mark.parametrize(
    ("position", "s_m", "d_m", "way"),
    [
        (on_lane(-1, 150.0), 150.0, -1.75, 1),
        (on_lane(-2, 150.0, 0.5), 150.0, -4.75, 1),
        (on_lane(1, 150.0), 150.0, 1.75, -1),
        (on_lane(-1, 150.0, inside=FACING.format("absolute", pi)), 150.0, -1.75, -1),
        (on_lane(-1, 150.0, inside='<Orientation h="${pi}"/>'), 150.0, -1.75, -1),
        (on_lane(1, 150.0, inside=FACING.format("relative", pi)), 150.0, 1.75, 1),
        ('<RoadPosition roadId="7" s="150" t="-5.25"/>', 150.0, -5.25, 1),
        ('<WorldPosition x="150" y="-1.75"/>', 150.0, -1.75, 1),
        (f'<WorldPosition x="150" y="1.75" h="{pi}"/>', 150.0, 1.75, -1),
        ('<RelativeLanePosition entityRef="Ego" dLane="-1" ds="50"/>', 150.0, -5.25, 1),
        ('<RelativeLanePosition entityRef="Ego" dLane="0" dsLane="50" offset="-0.3"/>', 150.0, -2.05, 1),
        ('<RelativeLanePosition entityRef="Ego" dLane="1" ds="50"/>', 150.0, 1.75, -1),
        ('<RelativeRoadPosition entityRef="Ego" ds="50" dt="1"/>', 150.0, -0.75, 1),
        ('<RelativeObjectPosition entityRef="Ego" dx="50" dy="-3.5"/>', 150.0, -5.25, 1),
        ('<RelativeWorldPosition entityRef="Ego" dx="-50" dy="-3.5"/>', 50.0, -5.25, 1),
    ],
)
def test_each_kind_of_position(position: str, s_m: float, d_m: float, way: int, tmp_path: Path) -> None:
    made = placed(tmp_path, position)
    (actor,) = made.actors
    centre = actor.place_m(made.road, made.ego.start_m, 0.0)
    assert centre - way * 1.5 == pytest.approx(s_m)
    assert made.road.lane_offset_m(actor.lane) + actor.offset_m == pytest.approx(d_m)
    assert actor.direction() == way


@pytest.mark.parametrize(
    ("position", "s_m", "d_m"),
    [
        ('<WorldPosition x="20" y="150" h="${pi/2}"/>', 50.0, -20.0),
        ('<RelativeObjectPosition entityRef="Ego" dx="10" dy="-3.5"/>', 110.0, -5.25),
    ],
)
def test_positions_in_the_world_of_a_road_that_begins_elsewhere(
    position: str, s_m: float, d_m: float, tmp_path: Path
) -> None:
    plan = f'<geometry s="0" x="0" y="100" hdg="{pi / 2}" length="2000"><line/></geometry>'
    wide = xodr(plan).replace('a="3.5"', 'a="28"')
    made = placed(tmp_path, position, xodr(plan) if "Relative" in position else wide)
    (actor,) = made.actors
    assert actor.place_m(made.road, made.ego.start_m, 0.0) - 1.5 == pytest.approx(s_m)
    assert made.road.lane_offset_m(actor.lane) + actor.offset_m == pytest.approx(d_m)


@pytest.mark.parametrize("s_m", [60.0, 96.0, 99.0, 100.0, 102.0, 103.9, 104.1, 150.0])
def test_a_vehicle_beside_the_ego_vehicle_stays_where_the_file_puts_it(s_m: float, tmp_path: Path) -> None:
    made = placed(tmp_path, on_lane(-2, s_m))
    (state,) = world_state.at(made, 0.0).actors
    nose = 103.5
    assert made.ego.start_m == nose
    assert state.cuboid.center[0] == pytest.approx(s_m + 1.5 - nose)
    assert state.cuboid.center[1] == pytest.approx(-3.5)


def test_positions_may_refer_to_one_another_in_any_order(tmp_path: Path) -> None:
    parts = Parts(
        entities=entity("A") + entity("B") + entity("Ego"),
        init=init("A", '<RelativeRoadPosition entityRef="B" ds="10" dt="0"/>')
        + init("B", '<RelativeRoadPosition entityRef="Ego" ds="20" dt="0"/>')
        + init("Ego", on_lane(-1, 100.0), "20"),
    )
    assert sorted(actor.ahead_m for actor in parts.load(tmp_path).actors) == [16.0, 26.0]


@pytest.mark.parametrize(
    ("position", "says"),
    [
        (on_lane(-4, 150.0), "road 7 has no lane -4 at s = 150 m; vehicles drive on -2, -1, 1"),
        (on_lane(-1, 5000.0), r"lies at s = 5000.0 m, outside road 7 \(2000 m\)"),
        (on_lane(-1, -1.0), "outside road 7"),
        ('<RelativeLanePosition entityRef="Ego" dLane="7" ds="9"/>', "no driving lane 7 to the left of lane -1"),
        ('<RelativeLanePosition entityRef="Ego" dLane="0.5" ds="9"/>', "dLane=0.5 is not a whole number"),
        ('<RelativeRoadPosition entityRef="Lead" ds="9" dt="0"/>', "the position of Lead refers to itself"),
        ('<RelativeRoadPosition entityRef="Nobody" ds="9" dt="0"/>', "no entity 'Nobody'"),
        ('<LanePosition roadId="8" laneId="-1" s="9"/>', "no road '8' in road.xodr"),
        ("<RoutePosition/>", "RoutePosition has no RouteRef"),
        ("<TrajectoryPosition/>", "TrajectoryPosition has no TrajectoryRef"),
        ('<GeoPosition latitude="48" longitude="9"/>', "GeoPosition is not supported"),
        ("", "Position has 0 elements; expected one"),
    ],
)
def test_what_is_not_on_the_road(position: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=says):
        placed(tmp_path, position)


def test_two_positions_that_refer_to_each_other(tmp_path: Path) -> None:
    parts = Parts(
        entities=entity("A") + entity("B") + entity("Ego"),
        init=init("A", '<RelativeRoadPosition entityRef="B" ds="10" dt="0"/>')
        + init("B", '<RelativeRoadPosition entityRef="A" ds="20" dt="0"/>')
        + init("Ego", on_lane(-1, 100.0), "20"),
    )
    with pytest.raises(ScenarioError, match="refers to itself"):
        parts.load(tmp_path)


def test_the_ego_vehicle_drives_along_the_road(tmp_path: Path) -> None:
    """Whatever the direction of the file's road: on lane 1 it drives against it, and meets what lies at smaller s."""
    made = Parts(init=init("Ego", on_lane(1, 300.0), "20") + init("Lead", on_lane(1, 250.0), "10")).load(tmp_path)
    (state,) = world_state.at(made, 1.0).actors
    nose_m, centre_m = 300.0 - 3.5 - 20.0, 250.0 - 1.5 - 10.0
    assert state.cuboid.center[:2] == pytest.approx((nose_m - centre_m, 0.0), abs=1e-6)
    assert state.cuboid.yaw_rad == pytest.approx(0.0, abs=1e-9)


def test_a_vehicle_may_stand_on_the_shoulder(tmp_path: Path) -> None:
    made = placed(tmp_path, on_lane(-3, 150.0))
    assert made.road.lane_offset_m(made.actors[0].lane) + made.actors[0].offset_m == pytest.approx(-7.75)


def test_an_oncoming_vehicle_needs_an_oncoming_lane(tmp_path: Path) -> None:
    one_way = Parts().road.split("<left>")[0] + Parts().road.split("</left>")[1]
    with pytest.raises(ScenarioError, match="Lead drives against a road that has no oncoming lane"):
        placed(tmp_path, on_lane(-1, 150.0, inside=FACING.format("absolute", pi)), one_way)
