"""The storyboard: order of events, priorities, repeated events, acts that stop, catalogs of maneuvers, and its end."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.simulation.scenario import ScenarioError
from pipeline.simulation.world.actors import motion
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
)

BRAKE = speed_action("0", "linear", 10.0)


def lead_speed(folder: Path, stories: str, t_s: float) -> float:
    (actor,) = Parts(stories=stories, stop=condition(at_time(15.0))).load(folder).actors
    return actor.speed_and_accel(t_s)[0]


@pytest.mark.parametrize(
    ("priority", "expected_mps"),
    [("override", 16.0), ("overwrite", 16.0), ("parallel", 10.0), ("skip", 10.0)],
)
def test_an_event_of_another_vehicle_may_stop_a_running_one(priority: str, expected_mps: float, tmp_path: Path) -> None:
    weather = "<GlobalAction><EnvironmentAction/></GlobalAction>"
    stories = story(event("brake", BRAKE), event("next", weather, condition(at_time(2.0)), priority))
    assert lead_speed(tmp_path, stories, 5.0) == pytest.approx(expected_mps, abs=0.1)


def test_an_event_with_priority_skip_does_not_start_beside_another(tmp_path: Path) -> None:
    stories = story(event("brake", BRAKE), event("go", speed_action("30"), condition(at_time(2.0)), "skip"))
    assert lead_speed(tmp_path, stories, 8.0) == pytest.approx(4.0, abs=0.1)


def test_an_act_that_stops_ends_its_actions(tmp_path: Path) -> None:
    end = f"<StopTrigger>{condition(at_time(3.0))}</StopTrigger>"
    assert lead_speed(tmp_path, story(event("brake", BRAKE), of_act=end), 9.0) == pytest.approx(14.0, abs=0.1)


def test_an_act_waits_for_its_start(tmp_path: Path) -> None:
    begin = f"<StartTrigger>{condition(at_time(4.0))}</StartTrigger>"
    stories = story(event("brake", BRAKE), of_act=begin)
    assert lead_speed(tmp_path, stories, 4.0) == pytest.approx(20.0)
    assert lead_speed(tmp_path, stories, 9.0) == pytest.approx(10.0, abs=0.1)


@pytest.mark.parametrize(("times", "expected_mps"), [(1, 18.0), (3, 14.0)])
def test_an_event_may_happen_several_times(times: int, expected_mps: float, tmp_path: Path) -> None:
    slower = speed_action('<RelativeTargetSpeed entityRef="Lead" value="-2" speedTargetValueType="delta"/>')
    passed = condition(by_entity('<TraveledDistanceCondition value="40"/>'))
    stories = story(event("slower", slower, passed, more=f'maximumExecutionCount="{times}"'))
    assert lead_speed(tmp_path, stories, 10.0) == pytest.approx(expected_mps)


def test_a_maneuver_from_a_catalog_gets_its_parameters(tmp_path: Path) -> None:
    (tmp_path / "moves").mkdir()
    (tmp_path / "moves" / "m.xosc").write_text(
        '<OpenSCENARIO><Catalog name="moves"><Maneuver name="slow">'
        f"<ParameterDeclarations>{declared('to', '3')}</ParameterDeclarations>"
        f"{event('e', speed_action('$to'))}</Maneuver></Catalog></OpenSCENARIO>"
    )
    reference = (
        '<CatalogReference catalogName="moves" entryName="slow"><ParameterAssignments>'
        '<ParameterAssignment parameterRef="to" value="{}"/></ParameterAssignments></CatalogReference>'
    )
    parts = Parts(
        catalogs='<ManeuverCatalog><Directory path="moves"/></ManeuverCatalog>',
        stories=story().replace('<Maneuver name="m"></Maneuver>', reference.format("$fast")),
        parameters=declared("fast", "7"),
    )
    assert parts.load(tmp_path).actors[0].speed_mps == {0.0: 7.0}
    parts.stories = parts.stories.replace('parameterRef="to"', 'parameterRef="from"')
    with pytest.raises(ScenarioError, match="no parameter 'from' is declared"):
        parts.load(tmp_path)


STOPS = {
    "by time": (condition(at_time(6.0)), 6.0),
    "after a collision": (
        condition(by_entity('<CollisionCondition><EntityRef entityRef="Lead"/></CollisionCondition>'), delay=1.0),
        4.6 + 1.0,
    ),
    "by distance": (condition(by_entity('<TraveledDistanceCondition value="100"/>')), 5.0),
}


@pytest.mark.parametrize("how", STOPS)
def test_the_stop_trigger_ends_the_drive(how: str, tmp_path: Path) -> None:
    stop, expected_s = STOPS[how]
    parts = Parts(init=init("Ego", on_lane(-1, 100.0), "20") + init("Lead", on_lane(-1, 150.0), "10"), stop=stop)
    made = parts.load(tmp_path)
    assert made.duration_s == pytest.approx(expected_s, abs=0.041)
    assert made.notes == ()


def test_a_drive_without_a_stop_ends_with_the_road_or_after_two_minutes(tmp_path: Path) -> None:
    parts = Parts(stop="")
    made = parts.load(tmp_path)
    assert made.duration_s == pytest.approx((2000.0 - 103.5 + 2.0) / 20.0, abs=0.03)
    assert made.notes == ("The drive ends where the ego vehicle leaves road 7.",)
    parts.init = init("Ego", on_lane(-1, 100.0), "0")
    made = parts.load(tmp_path)
    assert made.duration_s == 120.0
    assert "No StopTrigger of the scenario fired within 120 s, so the drive ends then." in made.notes


STATE = by_value(
    '<StoryboardElementStateCondition storyboardElementType="event" storyboardElementRef="e" state="completeState"/>'
)


CHANGE = event("change", lane_action('<AbsoluteTargetLane value="-2"/>'))
NEXT = event("next", speed_action("9"), condition(at_time(1.0)), "override")
BACK = event("back", lane_action('<AbsoluteTargetLane value="-1"/>'), condition(at_time(1.0)))


@pytest.mark.parametrize(("then", "later_m"), [(NEXT, -1.75 - 3.5 * 0.103515625), (BACK, -1.75)])
def test_a_lane_change_that_is_interrupted(then: str, later_m: float, tmp_path: Path) -> None:
    """After a quarter of its 4 s, the quintic p³ (10 − 15 p + 6 p²) has done 10.35 % of it."""
    made = Parts(stories=story(CHANGE, then)).load(tmp_path)
    after = [motion(made.actors[0], made.road, t_s) for t_s in (1.0, 9.0)]
    assert [each.d_m for each in after] == pytest.approx([-1.75 - 3.5 * 0.103515625, later_m])
    assert after[1].d_rate_mps == 0.0


@pytest.mark.parametrize(
    ("stories", "says"),
    [
        (story(event("e", speed_action("9")), actors=""), "this action has no actors"),
        (story(event("e", speed_action("9")), actors="Nobody"), "no entity 'Nobody' with a position"),
        (
            story(event("e", speed_action("9"))).replace('"false">', '"true">'),
            "selectTriggeringEntities=true is not supported",
        ),
        (
            story(event("e", speed_action("9"))).replace('maximumExecutionCount="1"', 'maximumExecutionCount="2"', 1),
            "a ManeuverGroup that is repeated is not supported",
        ),
        (
            story(event("e", speed_action("9")), event("e", speed_action("9")), event("f", BRAKE, condition(STATE))),
            "several elements of type event are called 'e'",
        ),
        (story(*[event(f"e{i}", BRAKE) for i in range(501)]), "more than 500 events"),
        ("<Story/>", "Story has no name"),
    ],
)
def test_storyboards_that_are_refused(stories: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=says):
        Parts(stories=stories).load(tmp_path)
