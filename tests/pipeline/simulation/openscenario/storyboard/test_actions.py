"""Actions: speeds and lane changes as the file demands, and what is left out or refused."""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import pytest

from pipeline.simulation.scenario import Scenario, ScenarioError
from pipeline.simulation.world import world_state
from pipeline.simulation.world.actors import motion
from tests.pipeline.simulation.openscenario.files import (
    Parts,
    at_time,
    condition,
    event,
    init,
    lane_action,
    on_lane,
    speed_action,
    story,
)


def after(folder: Path, *actions: str, lane: int = -1, at_s: float = 2.0, actors: str = "Lead") -> Scenario:
    """Actions that start at a time; the lead drives at 20 m/s, 50 m ahead."""
    events = [event(f"e{i}", action, condition(at_time(at_s + 3.0 * i))) for i, action in enumerate(actions)]
    return Parts(
        init=init("Ego", on_lane(-1, 100.0), "20") + init("Lead", on_lane(lane, 150.0), "20"),
        stories=story(*events, actors=actors),
        stop=condition(at_time(20.0)),
    ).load(folder)


def speeds(made: Scenario, *times_s: float) -> list[float]:
    return [made.actors[0].speed_and_accel(time_s)[0] for time_s in times_s]


RELATIVE = '<RelativeTargetSpeed entityRef="Ego" value="{}" speedTargetValueType="{}" continuous="false"/>'


@pytest.mark.parametrize(
    ("action", "times_s", "expected"),
    [
        pytest.param(speed_action("10"), (1.9, 2.1), [20, 10], id="step"),
        pytest.param(speed_action("10", "linear", 4.0), (2.0, 4.0, 6.0, 9.0), [20, 15, 10, 10], id="time"),
        pytest.param(speed_action("10", "linear", 2.5, "rate"), (2.0, 4.0, 6.0), [20, 15, 10], id="rate"),
        pytest.param(speed_action("10", "linear", 60.0, "distance"), (2.0, 4.0, 6.0), [20, 15, 10], id="distance"),
        pytest.param(speed_action("30", "cubic", 4.0), (2.0, 3.0, 4.0, 6.0), [20, 21.5625, 25, 30], id="cubic"),
        pytest.param(speed_action("0", "sinusoidal", 4.0), (2.0, 4.0, 6.0), [20, 10, 0], id="sinusoidal"),
        pytest.param(
            speed_action("10", "sinusoidal", 10 * pi / 8, "rate"), (2.0, 4.0, 6.0), [20, 15, 10], id="highest rate"
        ),
        pytest.param(speed_action(RELATIVE.format(-5, "delta")), (2.1,), [15], id="slower than another"),
        pytest.param(speed_action(RELATIVE.format(0.5, "factor")), (2.1,), [10], id="half as fast"),
        pytest.param(speed_action("20", "linear", 2.0, "rate"), (1.0, 9.0), [20, 20], id="no change"),
    ],
)
def test_changes_of_speed(action: str, times_s: tuple[float, ...], expected: list[float], tmp_path: Path) -> None:
    assert speeds(after(tmp_path, action), *times_s) == pytest.approx(expected, abs=0.05)


def test_a_later_change_of_speed_takes_the_place_of_the_earlier(tmp_path: Path) -> None:
    made = after(tmp_path, speed_action("0", "linear", 10.0), speed_action("20", "linear", 2.0))
    assert speeds(made, 2.0, 5.0, 7.0, 12.0) == pytest.approx([20.0, 14.0, 20.0, 20.0])


def test_the_ego_vehicle_has_actions_too(tmp_path: Path) -> None:
    made = after(tmp_path, speed_action("0", "linear", 4.0), actors="Ego")
    assert made.ego.speed_and_accel(4.0)[0] == pytest.approx(10.0)
    assert made.actors[0].speed_mps == {0.0: 20.0}


def offsets(made: Scenario, *times_s: float) -> list[float]:
    return [motion(made.actors[0], made.road, time_s).d_m for time_s in times_s]


RIGHT = '<RelativeTargetLane entityRef="Lead" value="-1"/>'
OFFSET = (
    '<PrivateAction><LateralAction><LaneOffsetAction continuous="false">'
    '<LaneOffsetActionDynamics dynamicsShape="cubic" {}/><LaneOffsetTarget>'
    "{}</LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"
)


@pytest.mark.parametrize(
    ("action", "times_s", "expected"),
    [
        pytest.param(lane_action(RIGHT), (2.0, 4.0, 6.0), [-1.75, -3.5, -5.25], id="relative to itself"),
        pytest.param(lane_action('<AbsoluteTargetLane value="-2"/>'), (4.0, 6.0), [-3.5, -5.25], id="absolute"),
        pytest.param(
            lane_action('<RelativeTargetLane entityRef="Ego" value="-1"/>'), (6.0,), [-5.25], id="relative to another"
        ),
        pytest.param(lane_action(RIGHT, "linear", 80.0, "distance"), (4.0, 6.0), [-3.5, -5.25], id="distance"),
        pytest.param(lane_action(RIGHT, "linear", 0.875, "rate"), (4.0, 6.0), [-3.5, -5.25], id="rate"),
        pytest.param(
            lane_action(RIGHT).replace('targetLaneOffset="0"', 'targetLaneOffset="0.5"'), (6.0,), [-4.75], id="offset"
        ),
        pytest.param(
            OFFSET.format('maxLateralAcc="1"', '<AbsoluteTargetLaneOffset value="0.75"/>'),
            (2.0, 2.0 + sqrt(10 / sqrt(3) * 0.75) / 2, 5.0),
            [-1.75, -1.375, -1.0],
            id="lane offset",
        ),
        pytest.param(
            OFFSET.format('maxLateralAcc="1"', '<RelativeTargetLaneOffset entityRef="Ego" value="-0.5"/>'),
            (5.0,),
            [-2.25],
            id="offset from another",
        ),
    ],
)
def test_changes_of_lane(action: str, times_s: tuple[float, ...], expected: list[float], tmp_path: Path) -> None:
    assert offsets(after(tmp_path, action), *times_s) == pytest.approx(expected, abs=1e-6)


def test_the_highest_lateral_acceleration_is_the_demanded_one(tmp_path: Path) -> None:
    made = after(tmp_path, OFFSET.format('maxLateralAcc="1.2"', '<AbsoluteTargetLaneOffset value="1"/>'))
    times_s = [2.0 + i / 500 for i in range(1500)]
    assert max(abs(motion(made.actors[0], made.road, t).d_accel_mps2) for t in times_s) == pytest.approx(1.2, abs=0.01)


def test_a_vehicle_on_the_wrong_side_is_simulated_there(tmp_path: Path) -> None:
    facing = '<Orientation h="${pi}"/>'
    parts = Parts(init=init("Ego", on_lane(-1, 100.0), "10") + init("Lead", on_lane(-1, 200.0, inside=facing), "15"))
    (state,) = world_state.at(parts.load(tmp_path), 2.0).actors
    nose_m, centre_m = 103.5 + 2 * 10.0, 200.0 - 1.5 - 2 * 15.0
    assert state.cuboid.center[:2] == pytest.approx((centre_m - nose_m, 0.0))
    assert abs(state.cuboid.yaw_rad) == pytest.approx(pi)


JUMP = (
    '<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" {} {}/></LongitudinalAction>'
    "</PrivateAction>"
)


@pytest.mark.parametrize(
    ("how", "ahead_m"),
    [
        ('freespace="true" distance="12" displacement="leadingReferencedEntity"', 12.0),
        ('freespace="true" distance="12" displacement="trailingReferencedEntity"', -4.0 - 12.0),
        ('freespace="true" distance="12"', 12.0),
        ('freespace="false" distance="12" displacement="leadingReferencedEntity"', 8.0),
    ],
)
def test_a_distance_at_the_start(how: str, ahead_m: float, tmp_path: Path) -> None:
    made = after(tmp_path, JUMP.format(how, 'continuous="false"'), at_s=0.0)
    assert made.actors[0].ahead_m == pytest.approx(ahead_m)


TELEPORT = f"<PrivateAction><TeleportAction><Position>{on_lane(-2, 300.0)}</Position></TeleportAction></PrivateAction>"
ENTITY = '<GlobalAction><EntityAction entityRef="{}">{}</EntityAction></GlobalAction>'
SET_PARAMETER = '<GlobalAction><ParameterAction parameterRef="{}">{}</ParameterAction></GlobalAction>'
FOLLOW = "<PrivateAction><RoutingAction><FollowTrajectoryAction/></RoutingAction></PrivateAction>"


@pytest.mark.parametrize(
    ("action", "says"),
    [
        (TELEPORT, "TeleportAction is supported at the start only"),
        (
            JUMP.format('distance="12"', ""),
            "LongitudinalDistanceAction without DynamicConstraints is supported at the start",
        ),
        (FOLLOW, "FollowTrajectoryAction needs a Trajectory"),
        ("<PrivateAction><VisibilityAction/></PrivateAction>", "VisibilityAction is not supported"),
        (ENTITY.format("Lead", "<AddEntityAction/>"), "AddEntityAction for Lead is not supported; DeleteEntityAction"),
        (ENTITY.format("Ego", "<DeleteEntityAction/>"), "DeleteEntityAction for Ego is not supported"),
        (ENTITY.format("Lead", "<DeleteEntityAction/>"), "DeleteEntityAction is supported at the start only: Lead"),
        (SET_PARAMETER.format("speed", '<SetAction value="1"/>'), "no parameter 'speed' is declared"),
        ("<GlobalAction><TrafficAction/></GlobalAction>", "TrafficAction is not supported"),
        ("<UserDefinedAction/>", "UserDefinedAction is not supported"),
        (speed_action("500"), r"Lead: 500 m/s; the simulator drives forward, up to 100 m/s"),
        (speed_action(RELATIVE.format(-50, "delta")), "Lead: -30 m/s"),
        (speed_action("10", "wavy", 1.0), "dynamicsShape='wavy' is not supported; linear, cubic"),
        (speed_action("10", "linear", 1.0, "mood"), "dynamicsDimension='mood' is not supported"),
        (speed_action("10", "linear", -1.0), "expected a positive number"),
        (speed_action("10", "linear", 0.0, "rate"), "expected a positive number"),
        (lane_action(RIGHT, value=0.1), "duration_s: Input should be greater than 0.2"),
        (lane_action(RIGHT, value=99.0), "duration_s: Input should be less than or equal to 30"),
        (lane_action(RIGHT, "step"), "a lane change by a step is not supported"),
        (lane_action('<AbsoluteTargetLane value="-9"/>'), "has no driving lane -9"),
        (lane_action('<RelativeTargetLane entityRef="Lead" value="-4"/>'), "no driving lane 4 to the right of lane -1"),
        (OFFSET.format("", '<AbsoluteTargetLaneOffset value="1"/>'), "LaneOffsetAction needs a maxLateralAcc"),
    ],
)
def test_actions_that_are_refused(action: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=says) as error:
        after(tmp_path, action)
    assert str(error.value).startswith("drive.xosc, line 1: ")


CONTROL = "<PrivateAction><ControllerAction>{}</ControllerAction></PrivateAction>"
ASSIGN = '<AssignControllerAction {}><Controller name="driver"/></AssignControllerAction>'


def test_a_controller_that_takes_over_another_vehicle_is_refused(tmp_path: Path) -> None:
    driven = CONTROL.format(ASSIGN.format("") + '<ActivateControllerAction longitudinal="true" lateral="false"/>')
    with pytest.raises(ScenarioError, match="a controller drives Lead, which is not supported"):
        after(tmp_path, driven)
    with pytest.raises(ScenarioError, match="OverrideControllerValueAction for Lead is not supported"):
        after(
            tmp_path,
            CONTROL.format('<OverrideControllerValueAction><Brake active="true"/></OverrideControllerValueAction>'),
        )


def test_a_controller_that_does_not_is_left_out_with_a_note(tmp_path: Path) -> None:
    made = after(tmp_path, CONTROL.format(ASSIGN.format('activateLongitudinal="false"')))
    assert made.notes == ("The controller of Lead is left out: it follows its actions in the storyboard.",)
    default = CONTROL.format('<ActivateControllerAction longitudinal="true" lateral="true"/>')
    assert after(tmp_path, default).notes == ()
    assert after(tmp_path, default, actors="Ego").notes[0].startswith("The ego vehicle's controller is left out")


KEPT = OFFSET.replace('"false"', '"true"').format(
    'maxLateralAcc="1"', '<RelativeTargetLaneOffset entityRef="Ego" value="0.5"/>'
)


def test_an_offset_that_is_kept_from_a_vehicle_that_keeps_its_own(tmp_path: Path) -> None:
    assert offsets(after(tmp_path, KEPT), 9.0) == pytest.approx([-1.25])
    parts = Parts(
        stories=story(event("keep", KEPT, condition(at_time(1.0))))
        + story(event("away", lane_action('<AbsoluteTargetLane value="-2"/>'), condition(at_time(3.0))), actors="Ego")
        .replace('"s"', '"s2"')
        .replace('"act"', '"act2"')
    )
    with pytest.raises(ScenarioError, match="relative to Ego, which moves sideways meanwhile, is not supported"):
        parts.load(tmp_path)


def test_weather_and_lights_are_left_out_with_a_note(tmp_path: Path) -> None:
    lights = "<PrivateAction><AppearanceAction><LightStateAction/></AppearanceAction></PrivateAction>"
    weather = "<GlobalAction><EnvironmentAction/></GlobalAction>"
    signals = "<GlobalAction><InfrastructureAction/></GlobalAction>"
    made = after(tmp_path, lights, weather, lights, signals)
    assert [note.split(" ")[0] for note in made.notes] == ["Appearance", "Weather,", "Traffic"]
