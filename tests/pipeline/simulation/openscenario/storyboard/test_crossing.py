"""Road users that cross the ego vehicle's road, on foot, by bicycle or on roads of their own."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from pipeline.simulation.scenario import ScenarioError
from tests.pipeline.simulation.openscenario.files import (
    Parts,
    at_time,
    by_entity,
    by_value,
    condition,
    declared,
    event,
    init,
    lane_action,
    on_lane,
    speed_action,
    story,
    xodr,
)
from tests.pipeline.simulation.openscenario.walkers import (
    ACROSS,
    CROSS,
    TIMING,
    follow,
    polyline,
    pose,
    with_walker,
)


def test_a_trajectory_in_the_init_places_a_pedestrian_who_walks_along_it(tmp_path: Path) -> None:
    made = with_walker(follow(CROSS), speed_action("1.5")).load(tmp_path)
    assert made.actors == ()
    assert pose(made, 0.0) == pytest.approx((160.0, -6.75, pi / 2))
    assert pose(made, 4.0) == pytest.approx((160.0, -0.75, pi / 2))
    assert made.free_actors[0].kind == "pedestrian"


def test_an_offset_begins_farther_along_a_trajectory(tmp_path: Path) -> None:
    made = with_walker(follow(CROSS, more='initialDistanceOffset="3"'), speed_action("1")).load(tmp_path)
    assert pose(made, 1.0) == pytest.approx((160.0, -2.75, pi / 2))
    with pytest.raises(ScenarioError, match=r"initialDistanceOffset=30 lies outside the trajectory of 10\.0 m"):
        with_walker(follow(CROSS, more='initialDistanceOffset="30"')).load(tmp_path)


def test_a_trajectory_with_times_is_followed_by_them(tmp_path: Path) -> None:
    """It waits until 2 s, then is across at 6 s."""
    timed = polyline(ACROSS.format(-5), ACROSS.format(3), times=(2.0, 6.0))
    made = with_walker(follow(timed, TIMING)).load(tmp_path)
    assert [pose(made, t_s)[1] for t_s in (0.0, 2.0, 4.0, 6.0)] == pytest.approx([-6.75, -6.75, -2.75, 1.25], abs=0.01)


def test_a_pedestrian_who_faces_the_road_walks_across_it(tmp_path: Path) -> None:
    facing = f'<LanePosition roadId="7" laneId="-1" s="160" offset="-4"><Orientation h="{pi / 2}"/></LanePosition>'
    parts = with_walker(stories=story(event("e", speed_action("2"), condition(at_time(3.0))), actors="Walker"))
    parts.init = init("Ego", on_lane(-1, 100.0), "10") + init("Walker", facing)
    made = parts.load(tmp_path)
    assert [pose(made, t_s) for t_s in (3.0, 6.0)] == [
        pytest.approx(place, abs=0.01) for place in ((160.0, -5.75, pi / 2), (160.0, 0.25, pi / 2))
    ]


def test_a_pedestrian_on_a_lane_who_changes_it_faces_where_it_goes(tmp_path: Path) -> None:
    """3.5 m to the side in 4 s, at 1 m/s along the road: at half time 1.64 m/s sideways, 1.92 m/s over ground."""
    change = lane_action('<AbsoluteTargetLane value="-1"/>', value=4.0)
    parts = with_walker(stories=story(event("e", change, condition(at_time(1.0))), actors="Walker"))
    parts.init = init("Ego", on_lane(-1, 100.0), "10") + init("Walker", on_lane(-2, 160.0), "1")
    made = parts.load(tmp_path)
    assert pose(made, 0.5) == pytest.approx((160.5, -5.25, 0.0), abs=0.02)
    assert pose(made, 3.0)[2] == pytest.approx(np.arctan2(1.64, 1.0), abs=0.03)
    assert made.free_actors[0].speed_and_accel(3.0)[0] == pytest.approx(1.92, abs=0.02)
    assert pose(made, 7.0) == pytest.approx((167.0, -1.75, 0.0), abs=0.05)


SYNCHRONIZE = (
    '<PrivateAction><SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster>{}</TargetPositionMaster>'
    '<TargetPosition><TrajectoryPosition s="{}"><TrajectoryRef>{}</TrajectoryRef></TrajectoryPosition></TargetPosition>'
    '<FinalSpeed><AbsoluteSpeed value="{}"><TargetDistanceSteadyState distance="3"/></AbsoluteSpeed></FinalSpeed>'
    "</SynchronizeAction></PrivateAction>"
)


def test_a_crossing_pedestrian_meets_the_ego_vehicle(tmp_path: Path) -> None:
    """The ego vehicle reaches s = 150 after 5 s; then the pedestrian is 5 m along its way, in the lane."""
    meet = SYNCHRONIZE.format(on_lane(-1, 150.0), 5.0, CROSS, 1.4)
    made = with_walker(follow(CROSS), stories=story(event("e", meet), actors="Walker")).load(tmp_path)
    assert pose(made, 0.0) == pytest.approx((160.0, -6.75, pi / 2))
    assert pose(made, 5.0) == pytest.approx((160.0, -1.75, pi / 2), abs=0.05)
    assert made.free_actors[0].speed_and_accel(4.0)[0] == pytest.approx(1.4, abs=0.01)


HIT = by_entity('<CollisionCondition><EntityRef entityRef="Walker"/></CollisionCondition>')
NEAR = by_entity(
    '<RelativeDistanceCondition entityRef="Walker" relativeDistanceType="{}" freespace="true" value="{}" '
    'rule="lessThan"/>'
)


@pytest.mark.parametrize(
    ("trigger", "after_s"),
    [
        pytest.param(NEAR.format("longitudinal", 20.0), (160.0 - 0.25 - 103.5 - 20.0) / 10, id="along"),
        pytest.param(NEAR.format("lateral", 2.0), (5.0 - 1.0 - 0.3 - 2.0) / 1.0, id="across"),
        pytest.param(by_entity('<TraveledDistanceCondition value="3"/>', "Walker"), 3.0, id="walked"),
        pytest.param(
            by_entity(
                '<TimeToCollisionCondition value="2" freespace="true" rule="lessThan"><TimeToCollisionConditionTarget>'
                '<EntityRef entityRef="Walker"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>'
            ),
            (160.0 - 0.25 - 103.5) / 10 - 2.0,
            id="time to collision",
        ),
        pytest.param(
            by_entity('<AngleCondition angleType="heading" angle="1.57" angleTolerance="0.01"/>', "Walker"),
            0.0,
            id="angle",
        ),
        pytest.param(
            by_entity(f'<ReachPositionCondition tolerance="0.1"><Position>{ACROSS.format(-1)}</Position>'
                      "</ReachPositionCondition>", "Walker"), 3.9, id="reached",
        ),
    ],
)  # fmt: skip
def test_conditions_see_a_crossing_pedestrian(trigger: str, after_s: float, tmp_path: Path) -> None:
    """It walks at 1 m/s from 5 m to the right of the ego vehicle's lane; the drive ends when the condition holds."""
    stop = condition(trigger, delay=1.0)
    made = with_walker(follow(CROSS), speed_action("1"), stop=stop).load(tmp_path)
    assert made.duration_s == pytest.approx(max(after_s + 1.0, 1.0), abs=0.05)


@pytest.mark.parametrize(("speed", "hit_s"), [("0.8", 5.66), ("3", None)])
def test_a_collision_needs_both_at_the_same_place(speed: str, hit_s: float | None, tmp_path: Path) -> None:
    """The ego vehicle's nose is at s = 160 after 5.65 s; a fast pedestrian is across by then."""
    stop = condition(HIT) + condition(at_time(9.0))
    made = with_walker(follow(CROSS), speed_action(speed), stop=stop).load(tmp_path)
    assert made.duration_s == pytest.approx(9.0 if hit_s is None else hit_s, abs=0.05)


def test_traffic_on_the_left_is_mirrored(tmp_path: Path) -> None:
    """From the near kerb, on the left, to the right: in the simulator from the right to the left."""
    facing = f'<LanePosition roadId="7" laneId="1" s="160" offset="4"><Orientation h="{-pi / 2}"/></LanePosition>'
    parts = with_walker()
    parts.init = init("Ego", on_lane(1, 100.0), "10") + init("Walker", facing, "1")
    parts.road = xodr(of_road='rule="LHT"')
    made = parts.load(tmp_path)
    assert pose(made, 0.0) == pytest.approx((160.0, -5.75, pi / 2))
    assert pose(made, 3.0) == pytest.approx((160.0, -2.75, pi / 2))


# ---------------------------------------------------------------- other actions

DELETE = '<GlobalAction><EntityAction entityRef="Lead"><DeleteEntityAction/></EntityAction></GlobalAction>'


def test_an_entity_that_is_deleted_at_once_is_left_out(tmp_path: Path) -> None:
    made = Parts(stories=story(event("e", DELETE, condition(at_time(0.1))), actors="")).load(tmp_path)
    assert made.actors == ()
    assert "Lead is left out: the file deletes it as the drive begins." in made.notes


@pytest.mark.parametrize(
    ("how", "ends_s"),
    [
        ('<SetAction value="9"/>', 3.0),
        ("<ModifyAction><Rule><AddValue value='4'/></Rule></ModifyAction>", 3.0),
        ('<SetAction value="1"/>', 10.0),
    ],
)
def test_parameter_actions_are_seen_by_conditions(how: str, ends_s: float, tmp_path: Path) -> None:
    action = f'<GlobalAction><ParameterAction parameterRef="level">{how}</ParameterAction></GlobalAction>'
    parts = Parts(
        parameters=declared("level", "5"),
        stories=story(event("e", action, condition(at_time(3.0)))),
        stop=condition(by_value('<ParameterCondition parameterRef="level" rule="greaterThan" value="8"/>'))
        + condition(at_time(10.0)),
    )
    assert parts.load(tmp_path).duration_s == pytest.approx(ends_s, abs=0.05)
