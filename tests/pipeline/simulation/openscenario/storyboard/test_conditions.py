"""Triggers: each kind of condition fires when it should, with its edge and delay."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.simulation.scenario import ScenarioError
from tests.pipeline.simulation.openscenario.files import (
    Parts,
    at_time,
    by_entity,
    by_value,
    condition,
    event,
    init,
    on_lane,
    speed_action,
    story,
)

STEP_S = 0.02


def drive(trigger: str, lead_mps: str = "10", variables: str = "", before: str = "") -> Parts:
    """The ego vehicle approaches at 20 m/s from 50 m between reference points, 46 m between faces; when the trigger
    fires, the lead's speed jumps to 5 m/s. before: further events."""
    return Parts(
        variables=variables,
        init=init("Ego", on_lane(-1, 100.0), "20") + init("Lead", on_lane(-1, 150.0), lead_mps),
        stories=story(before, event("jump", speed_action("5"), trigger)),
        stop=condition(at_time(8.0)),
    )


def fired_at(folder: Path, parts: Parts) -> float | None:
    """When the lead's speed jumped."""
    (actor,) = parts.load(folder).actors
    return min((time_s for time_s, speed_mps in actor.speed_mps.items() if speed_mps == 5.0), default=None)


GAP = (
    '<RelativeDistanceCondition entityRef="Lead" relativeDistanceType="{}" freespace="{}" rule="lessThan" value="{}"/>'
)
HEADWAY = '<TimeHeadwayCondition entityRef="Lead" freespace="{}" {} rule="lessThan" value="{}"/>'
TTC = (
    '<TimeToCollisionCondition freespace="true" rule="lessThan" value="2">'
    '<TimeToCollisionConditionTarget><EntityRef entityRef="Lead"/></TimeToCollisionConditionTarget>'
    "</TimeToCollisionCondition>"
)
ANGLE = '<AngleCondition angleType="{}" angle="{}" angleTolerance="0.01"/>'
REACHED = '<ReachPositionCondition tolerance="1"><Position>{}</Position></ReachPositionCondition>'
DISTANCE = '<DistanceCondition value="30" rule="lessThan" freespace="false"><Position>{}</Position></DistanceCondition>'


@pytest.mark.parametrize(
    ("trigger", "expected_s"),
    [
        pytest.param(condition(at_time(2.0)), 2.0, id="time"),
        pytest.param(condition(at_time(2.0), delay=1.5), 3.5, id="delay"),
        pytest.param(condition(at_time(0.0)), 0.0, id="at once"),
        pytest.param(condition(at_time(0.0), edge="rising"), None, id="no edge without a change"),
        pytest.param(condition(at_time(2.0), edge="rising"), 2.0, id="rising edge"),
        pytest.param(
            condition(by_value('<SimulationTimeCondition value="2" rule="lessThan"/>'), edge="falling"),
            2.0,
            id="falling",
        ),
        pytest.param(condition(at_time(2.0), delay=1.0, edge="risingOrFalling"), 3.0, id="edge with delay"),
        pytest.param(condition(at_time(3.0)) + condition(at_time(1.0)), 1.0, id="any group"),
        pytest.param(
            condition(at_time(1.0)).replace("</ConditionGroup>", "")
            + condition(at_time(3.0)).replace("<ConditionGroup>", ""),
            3.0,
            id="all of a group",
        ),
        pytest.param(condition(by_entity(GAP.format("longitudinal", "true", 26))), 2.0, id="gap between faces"),
        pytest.param(condition(by_entity(GAP.format("longitudinal", "false", 30))), 2.0, id="gap between points"),
        pytest.param(condition(by_entity(GAP.format("lateral", "true", 1))), 0.0, id="lateral gap"),
        pytest.param(condition(by_entity(GAP.format("euclidianDistance", "true", 26))), 2.0, id="gap in the plane"),
        pytest.param(condition(by_entity(HEADWAY.format("true", 'alongRoute="true"', 1.3))), 2.0, id="headway"),
        pytest.param(
            condition(by_entity(HEADWAY.format("false", 'relativeDistanceType="longitudinal"', 1.5))), 2.0, id="1.2"
        ),
        pytest.param(condition(by_entity(ANGLE.format("heading", 0.005))), 0.0, id="heading"),
        pytest.param(condition(by_entity(ANGLE.format("heading", 1.57))), None, id="another heading"),
        pytest.param(condition(by_entity(TTC)), 2.6, id="time to collision"),
        pytest.param(
            condition(by_entity(TTC, "Lead").replace('entityRef="Lead"/></TimeTo', 'entityRef="Ego"/></TimeTo')),
            2.6,
            id="time to collision from the front",
        ),
        pytest.param(condition(by_entity(REACHED.format(on_lane(-1, 141.0)))), 2.0, id="position reached"),
        pytest.param(condition(by_entity(DISTANCE.format(on_lane(-1, 170.0)))), 2.0, id="distance to a position"),
        pytest.param(condition(by_entity('<TraveledDistanceCondition value="40"/>')), 2.0, id="distance travelled"),
        pytest.param(condition(by_entity('<SpeedCondition value="15" rule="greaterThan"/>')), 0.0, id="speed"),
        pytest.param(
            condition(by_entity('<SpeedCondition value="15" rule="greaterThan"/>', "Ego", "Lead", rule="all")),
            None,
            id="speed of all",
        ),
        pytest.param(
            condition(by_entity('<RelativeSpeedCondition entityRef="Lead" value="9" rule="greaterThan"/>')),
            0.0,
            id="relative speed",
        ),
        pytest.param(
            condition(by_entity('<CollisionCondition><EntityRef entityRef="Lead"/></CollisionCondition>')),
            4.6,
            id="collision",
        ),
    ],
)
def test_each_condition(trigger: str, expected_s: float | None, tmp_path: Path) -> None:
    found = fired_at(tmp_path, drive(trigger))
    assert found == (None if expected_s is None else pytest.approx(expected_s, abs=STEP_S + 0.002))


def test_a_standstill_lasts(tmp_path: Path) -> None:
    trigger = condition(by_entity('<StandStillCondition duration="1.5"/>', "Lead"))
    brake = event("brake", speed_action("0", "linear", 2.0))
    assert fired_at(tmp_path, drive(trigger, before=brake)) == pytest.approx(3.5, abs=2 * STEP_S)


STATE = '<StoryboardElementStateCondition storyboardElementType="{}" storyboardElementRef="{}" state="{}"/>'


@pytest.mark.parametrize(
    ("kind", "name", "state", "expected_s"),
    [
        ("event", "brake", "completeState", 3.0),
        ("event", "brake", "runningState", 1.0),
        ("event", "brake", "startTransition", 1.0),
        ("event", "brake", "endTransition", 3.0),
        ("event", "brake", "standbyState", 0.0),
        ("action", "s::act::a_brake", "completeState", 3.0),
        ("act", "act", "runningState", 0.0),
        ("maneuver", "m", "completeState", None),
    ],
)
def test_states_of_the_storyboard(kind: str, name: str, state: str, expected_s: float | None, tmp_path: Path) -> None:
    trigger = condition(by_value(STATE.format(kind, name, state)))
    brake = event("brake", speed_action("8", "linear", 2.0), condition(at_time(1.0)))
    found = fired_at(tmp_path, drive(trigger, before=brake))
    assert found == (None if expected_s is None else pytest.approx(expected_s, abs=2 * STEP_S))


def test_a_variable_that_an_action_sets(tmp_path: Path) -> None:
    trigger = condition(by_value('<VariableCondition variableRef="go" rule="greaterOrEqual" value="3"/>'), delay=1.0)
    action = '<GlobalAction><VariableAction variableRef="go">{}</VariableAction></GlobalAction>'
    put = event("put", action.format('<SetAction value="1"/>'), condition(at_time(1.0)))
    add = event(
        "add",
        action.format('<ModifyAction><Rule><AddValue value="2"/></Rule></ModifyAction>'),
        condition(at_time(2.0)),
    )
    variable = '<VariableDeclaration name="go" variableType="double" value="0"/>'
    parts = drive(trigger, variables=variable, before=put + add)
    assert fired_at(tmp_path, parts) == pytest.approx(3.0, abs=2 * STEP_S)


BRAKE = event("brake", speed_action("6", "linear", 2.0, "rate"), condition(at_time(3.0)))
ACCELERATION = '<AccelerationCondition value="-1.5" rule="lessThan"/>'
BEHIND = '<RelativeObjectPosition entityRef="Ego" dx="{}" dy="0"/>'


@pytest.mark.parametrize(
    ("inside", "who", "expected_s"),
    [
        (ACCELERATION, "Lead", 3.04),
        (DISTANCE.format(BEHIND.format(0)), "Lead", 2.0),
        (DISTANCE.format(BEHIND.format(-10)), "Lead", 3.0),
        ("<OffroadCondition duration='0'/>", "Ego", None),
        ("<EndOfRoadCondition duration='1'/>", "Ego", None),
    ],
)
def test_conditions_on_motion_and_moving_places(
    inside: str, who: str, expected_s: float | None, tmp_path: Path
) -> None:
    """The ego vehicle approaches by 10 m/s from 50 m."""
    parts = drive(condition(by_entity(inside, who)), before=BRAKE if inside == ACCELERATION else "")
    assert fired_at(tmp_path, parts) == (None if expected_s is None else pytest.approx(expected_s, abs=2 * STEP_S))


def test_a_vehicle_that_has_left_the_road(tmp_path: Path) -> None:
    """The lead's middle, 1.5 m ahead of its reference point, passes the end at 1998.5 m after 4.85 s."""
    parts = drive(condition(by_entity("<EndOfRoadCondition duration='1'/>", "Lead")))
    parts.init = init("Ego", on_lane(-1, 1000.0), "20") + init("Lead", on_lane(-1, 1950.0), "10")
    assert fired_at(tmp_path, parts) == pytest.approx(4.85 + 1.0, abs=2 * STEP_S)


def test_criteria_of_a_carla_file_trigger_nothing(tmp_path: Path) -> None:
    """Alone in a group they never fire; beside a condition they do not matter."""
    criterion = condition(by_value('<ParameterCondition parameterRef="" value="" rule="lessThan"/>'))
    criterion = criterion.replace('name="c"', 'name="criteria_CollisionTest"')
    assert fired_at(tmp_path, drive(criterion)) is None
    both = criterion.replace("</ConditionGroup>", "") + condition(at_time(2.0)).replace("<ConditionGroup>", "")
    assert fired_at(tmp_path, drive(both)) == pytest.approx(2.0, abs=2 * STEP_S)


@pytest.mark.parametrize(
    ("trigger", "says"),
    [
        (condition(by_value("<TimeOfDayCondition/>")), "TimeOfDayCondition is not supported; SimulationTime"),
        (condition(by_entity("<TrafficSignalCondition/>")), "TrafficSignalCondition is not supported; TimeHeadway"),
        (condition(by_entity(ANGLE.format("pitch", 1))), "AngleCondition is supported for the heading in the world"),
        (
            condition(by_entity('<AccelerationCondition direction="lateral" value="1"/>')),
            "AccelerationCondition is supported along the road only",
        ),
        (condition(by_entity(TTC, "Nobody")), "no entity 'Nobody' with a position"),
        (condition(at_time(1.0), edge="sideways"), "unknown conditionEdge 'sideways'"),
        (condition(at_time(1.0), delay=-1.0), "a negative delay"),
        (condition(by_value('<SimulationTimeCondition value="1" rule="near"/>')), "unknown rule 'near'"),
        (condition(by_value('<SimulationTimeCondition value="soon"/>')), "'soon' is not a number in range"),
        (condition(by_value('<VariableCondition variableRef="x" rule="equalTo" value="1"/>')), "no variable 'x'"),
        (condition(by_value('<ParameterCondition parameterRef="x" rule="equalTo" value="1"/>')), "no parameter 'x'"),
        (condition(by_value(STATE.format("event", "nothing", "completeState"))), "no event 'nothing'"),
        (condition(by_entity(GAP.format("around", "true", 1))), "distance type 'around' is not supported"),
        (condition(by_entity('<CollisionCondition><ByType type="vehicle"/></CollisionCondition>')), "with a ByType"),
        (condition(by_entity(REACHED.format("<RoutePosition/>"))), "RoutePosition has no RouteRef"),
        (condition(""), "has neither ByValueCondition nor ByEntityCondition"),
    ],
)
def test_conditions_that_are_refused(trigger: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=says) as error:
        drive(trigger).load(tmp_path)
    assert str(error.value).startswith("drive.xosc, line 1: ")
