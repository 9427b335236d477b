"""Speeds that follow another vehicle, a profile or an appointment, against their formulae."""

from __future__ import annotations

from itertools import pairwise
from math import exp, sqrt
from pathlib import Path

import pytest

from pipeline.simulation.openscenario.storyboard.running import STEP_S
from pipeline.simulation.scenario import Scenario, ScenarioError
from pipeline.simulation.world.actors import Script
from tests.pipeline.simulation.openscenario.files import (
    Parts,
    at_time,
    by_value,
    condition,
    event,
    init,
    on_lane,
    speed_action,
    story,
)

RELATIVE = '<RelativeTargetSpeed entityRef="Ego" value="{}" speedTargetValueType="{}" continuous="true"/>'
BRAKING = story(event("brake", speed_action("10", "linear", 4.0), condition(at_time(2.0))), actors="Ego")
OTHER = {'"s"': '"s2"', '"act"': '"act2"', '"g"': '"g2"', '"m"': '"m2"'}


def also(text: str) -> str:
    """A second story beside another."""
    for old, new in OTHER.items():
        text = text.replace(f"name={old}", f"name={new}")
    return text


def play(
    folder: Path, action: str, lead: tuple[float, float] = (150.0, 20.0), more: str = "", stop_s: float = 30.0
) -> Scenario:
    """The lead starts its action at 1 s; the ego vehicle drives at 20 m/s. Both are 4 m long. lead: s and speed."""
    return Parts(
        init=init("Ego", on_lane(-1, 100.0), "20") + init("Lead", on_lane(-1, lead[0]), str(lead[1])),
        stories=story(event("act", action, condition(at_time(1.0)))) + more,
        stop=condition(at_time(stop_s)),
    ).load(folder)


def speeds(script: Script, *times_s: float) -> list[float]:
    return [script.speed_and_accel(time_s)[0] for time_s in times_s]


def gap_m(made: Scenario, t_s: float) -> float:
    """From the ego vehicle's nose to the lead's rear."""
    return made.actors[0].ahead_m + made.actors[0].travelled_m(t_s) - made.ego.travelled_m(t_s)


@pytest.mark.parametrize(("value", "kind"), [(1.5, "factor"), (5.0, "delta")])
def test_a_speed_that_stays_relative(value: float, kind: str, tmp_path: Path) -> None:
    made = play(tmp_path, speed_action(RELATIVE.format(value, kind)), more=also(BRAKING), stop_s=12.0)
    for t_s in (1.5, 3.0, 4.0, 5.5, 9.0, 11.0):
        own = speeds(made.ego, t_s)[0]
        assert speeds(made.actors[0], t_s)[0] == pytest.approx(
            own * value if kind == "factor" else own + value, abs=0.02
        )


def test_a_relative_speed_is_reached_by_its_dynamics(tmp_path: Path) -> None:
    made = play(tmp_path, speed_action(RELATIVE.format(8, "delta"), "linear", 4.0), stop_s=9.0)
    assert speeds(made.actors[0], 1.0, 3.0, 5.0, 8.0) == pytest.approx([20.0, 24.0, 28.0, 28.0], abs=0.02)


def test_a_steady_relative_speed_needs_few_corners(tmp_path: Path) -> None:
    made = play(tmp_path, speed_action(RELATIVE.format(8, "delta")))
    assert len(made.actors[0].speed_mps) < 6


def test_a_later_speed_action_ends_it(tmp_path: Path) -> None:
    stories = story(
        event("keep", speed_action(RELATIVE.format(5, "delta")), condition(at_time(1.0))),
        event("own", speed_action("9"), condition(at_time(3.0))),
    )
    made = Parts(stories=stories + also(BRAKING)).load(tmp_path)
    assert speeds(made.actors[0], 2.5, 3.1, 9.0) == pytest.approx([23.75, 9.0, 9.0], abs=0.03)


DISTANCE = (
    '<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" freespace="{}" continuous="{}" {}>'
    "{}</LongitudinalDistanceAction></LongitudinalAction></PrivateAction>"
)
FREE = "<DynamicConstraints/>"


@pytest.mark.parametrize(("freespace", "gap"), [("true", 30.0), ("false", 26.0)])
def test_a_distance_is_approached_as_a_critically_damped_spring(freespace: str, gap: float, tmp_path: Path) -> None:
    """e(t) = e₀ (1 + ω t) exp(−ω t) with ω² = 0.4 / s², from a gap of 46 m at equal speeds."""
    made = play(tmp_path, DISTANCE.format(freespace, "true", 'distance="30"', FREE))
    omega = sqrt(0.4)
    for after_s in (0.5, 1.0, 2.0, 4.0, 8.0):
        error = (46.0 - gap) * (1.0 + omega * after_s) * exp(-omega * after_s)
        assert gap_m(made, 1.0 + after_s) - gap == pytest.approx(error, abs=0.15)
    assert gap_m(made, 29.0) == pytest.approx(gap, abs=0.02)


def test_limits_of_an_approach(tmp_path: Path) -> None:
    limits = '<DynamicConstraints maxAcceleration="1" maxDeceleration="2" maxSpeed="23" maxAccelerationRate="0.5"/>'
    made = play(tmp_path, DISTANCE.format("true", "true", 'distance="100"', limits), stop_s=60.0)
    corners = list(made.actors[0].speed_mps.items())
    slopes = [(b - a) / (t - s) for (s, a), (t, b) in pairwise(corners) if t - s > 1e-3]
    assert -2.02 <= min(slopes) < 0.0 < max(slopes) <= 1.02
    assert max(made.actors[0].speed_mps.values()) == pytest.approx(23.0)
    assert speeds(made.actors[0], 2.0, 3.0) == pytest.approx([20.25, 21.0], abs=0.03)  # a rises by 0.5 m/s² each second


def test_a_time_gap_grows_with_the_speed(tmp_path: Path) -> None:
    made = play(tmp_path, DISTANCE.format("true", "true", 'timeGap="1.5"', FREE), (50.0, 20.0), also(BRAKING), 40.0)
    assert -gap_m(made, 2.0) - 4.0 > 25.0
    behind_m = made.ego.travelled_m(39.0) - made.actors[0].travelled_m(39.0) - made.actors[0].ahead_m - 4.0
    assert behind_m == pytest.approx(1.5 * 10.0, abs=0.05)


def test_a_distance_that_is_reached_once_ends_the_action(tmp_path: Path) -> None:
    state = '<StoryboardElementStateCondition storyboardElementType="action" storyboardElementRef="a_act" state="{}"/>'
    parts = Parts(
        stories=story(event("act", DISTANCE.format("true", "false", 'distance="30"', FREE))),
        stop=condition(by_value(state.format("completeState"))),
    )
    made = parts.load(tmp_path)
    assert 5.0 < made.duration_s < 20.0
    assert gap_m(made, made.duration_s) == pytest.approx(30.0, abs=0.11)


PROFILE = (
    '<PrivateAction><LongitudinalAction><SpeedProfileAction followingMode="{}">{}{}</SpeedProfileAction>'
    "</LongitudinalAction></PrivateAction>"
)
LIMITS = '<DynamicConstraints maxAcceleration="2" maxDeceleration="4"/>'
ENTRIES = '<SpeedProfileEntry time="2" speed="30"/><SpeedProfileEntry time="5" speed="10"/>'


@pytest.mark.parametrize(
    ("mode", "limits", "entries", "times_s", "expected"),
    [
        ("position", LIMITS, ENTRIES, (1.0, 2.0, 3.0, 5.5, 8.0, 12.0), [20, 25, 30, 20, 10, 10]),
        ("follow", "", ENTRIES, (2.0, 3.0, 8.0), [25, 30, 10]),
        ("follow", LIMITS, ENTRIES, (2.0, 6.0, 8.5, 11.0), [22, 30, 20, 10]),
        ("follow", LIMITS, '<SpeedProfileEntry speed="30"/><SpeedProfileEntry speed="10"/>', (6.0, 11.0), [30, 10]),
    ],
)
def test_profiles(
    mode: str, limits: str, entries: str, times_s: tuple[float, ...], expected: list[float], tmp_path: Path
) -> None:
    made = play(tmp_path, PROFILE.format(mode, limits, entries), stop_s=14.0)
    assert speeds(made.actors[0], *times_s) == pytest.approx(expected, abs=0.01)


def test_a_profile_with_limited_jerk(tmp_path: Path) -> None:
    """20 → 30 m/s at 2 m/s² and 1 and 2 m/s³ takes 10 / 2 + 2 (1 / 1 + 1 / 2) / 2 = 6.5 s: it rises for 2 s, by 2 m/s,
    and falls for 1 s, by 1 m/s."""
    jerk = (
        '<DynamicConstraints maxAcceleration="2" maxDeceleration="4" maxAccelerationRate="1" maxDecelerationRate="2"/>'
    )
    made = play(tmp_path, PROFILE.format("follow", jerk, '<SpeedProfileEntry time="1" speed="30"/>'), stop_s=9.0)
    assert speeds(made.actors[0], 2.0, 3.0, 6.5, 7.5, 8.5) == pytest.approx([20.5, 22.0, 29.0, 30.0, 30.0], abs=0.02)
    slow = play(tmp_path, PROFILE.format("follow", jerk, '<SpeedProfileEntry time="10" speed="30"/>'), stop_s=12.0)
    assert speeds(slow.actors[0], 10.9, 11.0) == pytest.approx([29.99, 30.0], abs=0.02)


MEET = (
    '<PrivateAction><SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster>{}</TargetPositionMaster>'
    "<TargetPosition>{}</TargetPosition>{}</SynchronizeAction></PrivateAction>"
)
FINAL = '<FinalSpeed><AbsoluteSpeed value="15">{}</AbsoluteSpeed></FinalSpeed>'


@pytest.mark.parametrize(
    ("final", "held_s"),
    [
        ("", None),
        (FINAL.format(""), 0.0),
        (FINAL.format('<TargetTimeSteadyState time="2"/>'), 1.9),
        (FINAL.format('<TargetDistanceSteadyState distance="30"/>'), 1.9),
        ('<FinalSpeed><RelativeSpeedToMaster value="-5"/></FinalSpeed>', 0.0),
    ],
)
def test_two_vehicles_arrive_together(final: str, held_s: float | None, tmp_path: Path) -> None:
    """The ego vehicle is 200 m before its place after 1 s and arrives 10 s later; the lead has 230 m to drive."""
    made = play(tmp_path, MEET.format(on_lane(-1, 320.0), on_lane(-1, 400.0), final), stop_s=14.0)
    assert made.actors[0].travelled_m(11.0) == pytest.approx(400.0 - 150.0, abs=1.0)
    if held_s is not None:
        assert speeds(made.actors[0], 11.0 - held_s, 11.0, 13.0) == pytest.approx([15.0] * 3, abs=0.5)


def test_an_appointment_is_kept_although_the_other_brakes(tmp_path: Path) -> None:
    made = play(tmp_path, MEET.format(on_lane(-1, 320.0), on_lane(-1, 400.0), ""), more=also(BRAKING), stop_s=24.0)
    times_s = [i * STEP_S for i in range(1200)]
    arrives, meets = (
        next(t for t in times_s if script.travelled_m(t) >= way)
        for script, way in ((made.ego, 220.0), (made.actors[0], 250.0))
    )
    assert arrives == pytest.approx(meets, abs=0.15)


@pytest.mark.parametrize(
    ("action", "says"),
    [
        (DISTANCE.format("true", "true", "", FREE), "needs either a distance or a timeGap"),
        (
            DISTANCE.format("true", "true", 'distance="9"', '<DynamicConstraints maxSpeed="0"/>'),
            "maxSpeed=0: expected a positive number",
        ),
        (PROFILE.format("follow", "", '<SpeedProfileEntry speed="9"/>'), "needs a time, or DynamicConstraints"),
        (PROFILE.format("follow", "", '<SpeedProfileEntry time="-1" speed="9"/>'), "a negative time"),
        (PROFILE.format("follow", "", '<SpeedProfileEntry time="1" speed="-9"/>'), "-9 m/s; the simulator drives forw"),
        (
            MEET.format(on_lane(-1, 320.0), on_lane(-1, 400.0), FINAL.format("<SteadyState/>")),
            "SteadyState with a final speed of 15 m/s is not supported",
        ),
        (MEET.format(on_lane(-1, 320.0), on_lane(-1, 9000.0), ""), "lies at s = 9000.0 m, outside road 7"),
        ("<PrivateAction><SynchronizeAction/></PrivateAction>", "SynchronizeAction has no masterEntityRef"),
    ],
)
def test_what_is_refused(action: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=says):
        play(tmp_path, action)
