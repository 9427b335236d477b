"""The car slows for its lead, returns to its speed, and never winds up. Manoeuvres are sentences."""

from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.decision.acc import AccState, control, desired_gap_m, follow, pid
from pipeline.decision.cipv import CipvState, choose
from pipeline.decision.object_motion import describe, required_decel_mps2
from pipeline.params import AccParams, AebParams, CipvParams, MotionParams, PathParams, preset
from pipeline.path.corridor import corridor
from pipeline.types import AccCommand, Braking, Cipv, EgoState, FusedObject, Situation
from tests.pipeline.build import fused, moment

PARAMS = AccParams(
    set_speed_kmh=108.0, min_gap_m=5.0, time_gap_s=1.5, ttc_limit_s=2.5, confirm_frames=1, kp=2.0, ki=0.05
)
EMERGENCY = AebParams()
PATH = corridor(None, PathParams(half_width_m=1.5))


def test_a_single_sweep_does_not_brake_for_what_is_beside_the_path() -> None:
    """When the corner of a parked car comes into view, the track jumps sideways once."""
    swerving = (fused(1, 15.0, 3.0, velocity=(-12.0, -2.0)),)
    ego = EgoState(0, 20.0)
    objects = choose(CipvState(), describe(swerving, ego, MotionParams()), PATH, moment(ego), CipvParams())[1].objects
    there, gone = (Situation(moment(ego, 0.1), PATH, seen, None) for seen in (objects, ()))
    params, state, said = PARAMS.model_copy(update={"confirm_frames": 2}), AccState(), []
    for now in (there, gone, there, there):
        state, result = control(state, now, params, EMERGENCY)
        assert result is not None
        said.append(result.state)
    assert said == ["cruise", "cruise", "cruise", "warn"]


def command(speed_mps: float, gap_m: float | None, *others: FusedObject, state: AccState | None = None) -> AccCommand:
    lead = None if gap_m is None else Cipv(99, gap_m, None, None, "")
    ego = EgoState(0, speed_mps)
    objects = choose(CipvState(), describe(others, ego, MotionParams()), PATH, moment(ego), CipvParams())[1].objects
    _, result = control(state or AccState(), Situation(moment(ego, 0.1), PATH, objects, lead), PARAMS, EMERGENCY)
    assert result is not None
    return result


@pytest.mark.parametrize(
    ("speed_mps", "gap_m", "desired_mps", "state"),
    [
        pytest.param(20.0, None, 30.0, "cruise", id="nothing ahead: the set speed, not v_current for ever"),
        pytest.param(20.0, 60.0, 30.0, "cruise", id="lead beyond the desired gap: the set speed"),
        pytest.param(20.0, 35.0, 20.0, "follow", id="exactly at the desired gap: hold the speed"),
        pytest.param(20.0, 20.0, 10.0, "follow", id="half way between the two gaps: half the speed"),
        pytest.param(20.0, 5.0, 0.0, "stop", id="at d_min: stop"),
        pytest.param(20.0, 2.0, 0.0, "stop", id="inside d_min: stop, never a negative speed"),
        pytest.param(0.0, 4.0, 0.0, "stop", id="standing behind a standing lead"),
        pytest.param(40.0, 64.9, 30.0, "follow", id="faster than the set speed: never above it"),
    ],
)
def test_gap_law(speed_mps: float, gap_m: float | None, desired_mps: float, state: str) -> None:
    result = command(speed_mps, gap_m)
    assert result.desired_speed_mps == pytest.approx(desired_mps, abs=0.05)
    assert result.state == state


@given(st.floats(0.0, 50.0), st.none() | st.floats(0.0, 200.0))
def test_desired_speed_stays_between_standstill_and_set_speed(speed_mps: float, gap_m: float | None) -> None:
    result = command(speed_mps, gap_m)
    assert 0.0 <= result.desired_speed_mps <= 30.0
    assert 0.0 <= result.accelerator <= 1.0
    assert 0.0 <= result.brake <= 1.0
    assert result.accelerator == 0.0 or result.brake == 0.0


def test_closer_is_never_faster() -> None:
    speeds = [command(20.0, gap).desired_speed_mps for gap in (2.0, 5.0, 10.0, 20.0, 30.0, 36.0, 80.0)]
    assert speeds == sorted(speeds)


@pytest.mark.parametrize(
    ("other", "state"),
    [
        pytest.param(fused(1, 15.0, 3.0, velocity=(-12.0, -2.0)), "warn", id="a car swerves into our path"),
        pytest.param(fused(1, 15.0, 0.0, velocity=(-12.0, 0.0), label="person"), "warn", id="an obstacle in our path"),
        pytest.param(fused(1, 15.0, 3.5, velocity=(-30.0, 0.0)), "cruise", id="oncoming in its own lane passes"),
        pytest.param(fused(1, 60.0, 0.0, velocity=(-12.0, 0.0)), "cruise", id="far enough"),
        pytest.param(fused(1, 15.0, 0.0, velocity=(3.0, 0.0)), "cruise", id="pulling away"),
        pytest.param(fused(1, 15.0, 6.0, velocity=(-12.0, -12.0)), "warn", id="crosses our path before we are there"),
    ],
)
def test_ttc_rule_for_objects_that_are_not_the_lead(other: FusedObject, state: str) -> None:
    assert command(20.0, None, other).state == state


def test_the_smallest_demand_wins_whatever_the_order() -> None:
    mild = fused(1, 25.0, 0.0, velocity=(-11.0, 0.0))
    hard = fused(2, 10.0, 0.0, velocity=(-12.0, 0.0))
    forward, backward = command(20.0, 34.0, mild, hard), command(20.0, 34.0, hard, mild)
    assert forward == backward
    assert "#2" in forward.reason
    assert forward.object_id == 2


@pytest.mark.parametrize(("distance_m", "object_id"), [(60.0, None), (20.0, 99), (2.0, 99), (None, None)])
def test_it_names_the_lead_that_it_slows_down_for(distance_m: float | None, object_id: int | None) -> None:
    assert command(20.0, distance_m).object_id == object_id


def test_no_ego_speed_no_command() -> None:
    state, result = control(AccState(5.0, 1.0), Situation(moment(None, 0.1), PATH, (), None), PARAMS, EMERGENCY)
    assert result is None
    assert state == AccState()


def test_integral_removes_a_standing_error_and_does_not_wind_up() -> None:
    state = AccState()
    for _ in range(100):
        state, small = pid(state, 0.5, 0.1, PARAMS)
    assert small > PARAMS.kp * 0.5 + 0.2  # the integral has added to the proportional part
    state = AccState()
    for _ in range(1000):
        state, full = pid(state, 40.0, 0.1, PARAMS)
    assert full == PARAMS.max_accel_mps2
    _, after = pid(state, -1.0, 0.1, PARAMS)
    assert after < 0.0, "after a long full throttle a small overspeed brakes at once"


def test_braking_may_be_left_to_others() -> None:
    comfortable = AccParams(brake_limit_mps2=3.5)
    assert pid(AccState(), -20.0, 0.1, comfortable)[1] == -3.5
    assert pid(AccState(), -20.0, 0.1, AccParams(brake_limit_mps2=0.0))[1] == 0.0
    assert pid(AccState(), -20.0, 0.1, AccParams())[1] == -8.0


def test_the_desired_gap_grows_with_speed() -> None:
    assert desired_gap_m(0.0, PARAMS) == 5.0
    assert desired_gap_m(20.0, PARAMS) == 35.0


def test_approaching_a_standing_car_from_100_m_at_72_km_h_the_car_stops_before_it() -> None:
    """Ideal actuators, exact distance, default parameters: the law and its PID alone end in standstill, no contact."""
    defaults = AccParams()
    speed, gap, state = 20.0, 100.0, AccState()
    for _ in range(1200):
        ego = EgoState(0, speed)
        state, result = control(
            state, Situation(moment(ego, 0.05), PATH, (), Cipv(1, gap, speed, None, "")), defaults, EMERGENCY
        )
        assert result is not None
        speed = max(speed + result.accel_mps2 * 0.05, 0.0)
        gap -= speed * 0.05
    assert speed == pytest.approx(0.0, abs=0.2)
    assert gap > 2.0


def test_on_an_unknown_path_acc_does_not_accelerate() -> None:
    """With any lead on an unknown path, and a much higher set speed, the car holds its speed and gives the reason;
    slowing down for the lead still has priority, and from standstill it may creep."""
    vague = dataclasses.replace(PATH, usable=False, reach_m=12.0, doubt="path known only 12 m ahead")
    limits = ((20.0, 20.0, "ACC will not accelerate"), (0.0, 3.0, "ACC will not exceed 11 km/h"))
    for speed_mps, wanted_mps, limit in limits:
        _, held = control(
            AccState(), Situation(moment(EgoState(0, speed_mps), 0.1), vague, (), None), PARAMS, EMERGENCY
        )
        assert held is not None
        assert held.desired_speed_mps == wanted_mps
        assert held.reason == f"path known only 12 m ahead: {limit}"
    eager, fast = AccState(integral_m=50.0, error_mps=0.0), moment(EgoState(0, 20.0), 0.1)
    assert control(eager, Situation(fast, PATH, (), None), PARAMS, EMERGENCY)[1].accelerator > 0.0  # type: ignore[union-attr]
    _, held = control(eager, Situation(fast, vague, (), None), PARAMS, EMERGENCY)
    assert held is not None
    assert held.accelerator == 0.0, "whatever the integral has gathered"
    _, follows = control(AccState(), Situation(fast, vague, (), Cipv(1, 20.0, None, None, "")), PARAMS, EMERGENCY)
    assert follows is not None
    assert follows.state == "follow"
    assert follows.desired_speed_mps == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("case", "distance_m", "closing_mps", "allowed_mps"),
    [
        ("standing, far enough away", 200.0, 27.0, None),
        ("standing, 100 m ahead", 100.0, 27.0, 21.8),
        ("as fast as we are", 70.0, 0.0, None),
        ("slower by 10 m/s, near the gap", 55.0, 10.0, 26.85),
        ("closing speed not known", 60.0, None, None),
    ],
)
def test_a_slow_lead_is_slowed_down_for_before_the_gap(
    case: str, distance_m: float, closing_mps: float | None, allowed_mps: float | None
) -> None:
    ego = EgoState(0, 27.0)
    demand = follow(ego, Cipv(1, distance_m, closing_mps, None, ""), 0.0, AccParams())
    assert demand.object_id == (1 if allowed_mps else None), case
    if allowed_mps is not None:
        assert demand.speed_mps == pytest.approx(allowed_mps, abs=0.1), case
    off = follow(ego, Cipv(1, distance_m, closing_mps, None, ""), 0.0, AccParams(approach_decel_mps2=0.0))
    assert off.state == "cruise", "as in the paper"


@pytest.mark.parametrize(
    ("case", "distance_m", "sigma_m", "closing_mps", "slower_mps", "reason"),
    [
        ("beyond the gap", 60.0, 8.0, 0.0, None, "lead #1 beyond the desired gap of 53.6 m"),
        ("surely too near", 40.0, 0.2, 0.0, 7.5, "lead #1 within the desired gap of 53.6 m"),
        ("too near by more than the error", 40.0, 8.0, 0.0, 3.1, "lead #1 within the desired gap of 53.6 m"),
        (
            "too near by less than the error",
            48.0,
            8.0,
            0.0,
            0.0,
            "lead #1 at the desired gap of 53.6 m within ±8.0 m: ACC will not accelerate",
        ),
        ("the same, but it brakes", 48.0, 8.0, 12.0, 3.1, "closing in on lead #1 too fast"),
        ("nearer than the gap at standstill", 4.9, 8.0, 0.0, 27.0, "lead #1 within the minimum gap of 5.0 m"),
    ],
)
def test_acc_slows_down_only_for_a_gap_that_is_too_short_beyond_its_error(
    case: str, distance_m: float, sigma_m: float, closing_mps: float, slower_mps: float | None, reason: str
) -> None:
    ego, lead = EgoState(0, 27.0), Cipv(1, distance_m, closing_mps, None, "")
    demand = follow(ego, lead, sigma_m, AccParams())
    assert demand.reason == reason, case
    if slower_mps is not None:
        assert ego.speed_mps - demand.speed_mps == pytest.approx(slower_mps, abs=0.1), case
    assert demand.no_faster is ("will not accelerate" in reason), case


def test_the_error_of_a_gap_is_the_camera_s() -> None:
    speeds = []
    for source, sigma_m in (("V", 8.0), ("VL", 0.2)):
        item = dataclasses.replace(fused(1, 48.0, source=source), distance_sigma_m=sigma_m)
        situation = Situation(moment(EgoState(0, 27.0), 0.1), PATH, (item,), Cipv(1, 48.0, 0.0, None, ""))
        result = control(AccState(), situation, AccParams(), AebParams())[1]
        assert result is not None
        speeds.append(result.desired_speed_mps)
    assert speeds[0] == 27.0
    assert speeds[1] < 25.0


@pytest.mark.parametrize(
    ("case", "gap_m", "lead_mps", "hardest_mps2"),
    [
        pytest.param("cuts in and pulls away", 15.0, 22.0, 3.5, id="the gap opens: comfortable"),
        pytest.param("cuts in, as fast as we are", 15.0, 20.0, 3.5, id="too near, but no nearer: comfortable"),
        pytest.param("slower by 5 m/s", 15.0, 15.0, 3.5, id="1 m/s² would do: comfortable"),
        pytest.param("slower by 14 m/s", 22.0, 6.0, 5.83, id="as hard as it takes"),
        pytest.param("stands, near", 20.0, 0.0, 8.0, id="as hard as the car can"),
    ],
)
def test_acc_brakes_hard_only_where_that_avoids_a_collision(
    case: str, gap_m: float, lead_mps: float, hardest_mps2: float
) -> None:
    ego = EgoState(0, 20.0)
    lead = Cipv(1, gap_m, 20.0 - lead_mps, None, "")
    braking = [-each for each in accelerations(ego, lead, 20)]
    assert braking[-1] == pytest.approx(hardest_mps2, abs=0.05), case
    at_once = min(max(required_decel_mps2(gap_m, 20.0 - lead_mps, EMERGENCY), 0.25), 8.0)
    assert braking[0] == pytest.approx(at_once, abs=0.05), case
    _, printed = control(AccState(), Situation(moment(ego, 0.1), PATH, (), lead), preset("paper").acc, EMERGENCY)
    assert printed is not None
    assert printed.accel_mps2 == -8.0, "the paper's law alone brakes fully inside the desired gap"


@pytest.mark.parametrize(
    ("margin_m", "reacts", "braking_mps2"),
    [
        pytest.param(0.4, True, 8.0, id="in the path"),
        pytest.param(-0.3, True, 3.5, id="beside it: comfortable"),
        pytest.param(-0.3, False, 8.0, id="beside it, switched off"),
    ],
)
def test_acc_brakes_hard_only_for_a_lead_that_this_frame_shows_in_the_path(
    margin_m: float, reacts: bool, braking_mps2: float
) -> None:
    item = dataclasses.replace(fused(1, 20.0, velocity=(-20.0, 0.0)), path_margin_m=margin_m)
    emergency = EMERGENCY.model_copy(update={"react_to_present": reacts})
    situation = Situation(moment(EgoState(0, 20.0), 0.1), PATH, (item,), Cipv(1, 20.0, 20.0, 1.0, ""))
    state, command = AccState(), None
    for _ in range(20):
        state, command = control(state, situation, PARAMS, emergency)
    assert command is not None
    assert command.accel_mps2 == pytest.approx(-braking_mps2, abs=0.05)


def test_acc_brakes_hard_only_for_a_lead_of_several_frames() -> None:
    """For a moment, two vehicles may be one cluster that reaches into the path."""
    params = PARAMS.model_copy(update={"confirm_frames": 2})
    ego, far, near = EgoState(0, 20.0), Cipv(1, 40.0, 0.0, None, ""), Cipv(2, 4.0, 20.0, 0.2, "")
    state, braking = AccState(), []
    for lead in (far, near, far, near, near):
        state, command = control(state, Situation(moment(ego, 0.1), PATH, (), lead), params, EMERGENCY)
        assert command is not None
        braking.append(-command.accel_mps2)
    assert max(braking[:4]) <= 3.5, "never two frames in a row"
    assert braking[4] == 8.0


@pytest.mark.parametrize(
    ("hits", "speed_hits", "braking_mps2"),
    [
        pytest.param(1, 2, 0.25, id="seen once: it may be a false box on a stray cluster"),
        pytest.param(1, 1, 3.5, id="seen once, switched off"),
        pytest.param(2, 2, 3.5, id="seen twice"),
    ],
)
def test_an_object_of_unknown_speed_is_braked_for_from_its_second_sighting(
    hits: int, speed_hits: int, braking_mps2: float
) -> None:
    item = dataclasses.replace(fused(1, 20.0, hits=hits), velocity_mps=None, justifies=Braking.PARTIAL)
    situation = Situation(moment(EgoState(0, 24.0), 0.1), PATH, (item,), Cipv(1, 20.0, None, None, ""))
    params = PARAMS.model_copy(update={"speed_hits": speed_hits})
    command = control(AccState(), situation, params, EMERGENCY)[1]
    assert command is not None
    assert command.accel_mps2 == pytest.approx(-braking_mps2)


def accelerations(ego: EgoState, lead: Cipv, frames: int, params: AccParams = PARAMS) -> list[float]:
    """Commanded accelerations in a number of frames without changes."""
    state, given = AccState(), []
    for _ in range(frames):
        state, result = control(state, Situation(moment(ego, 0.1), PATH, (), lead), params, EMERGENCY)
        assert result is not None
        given.append(result.accel_mps2)
    return given


@pytest.mark.parametrize(
    ("speed_mps", "jerk_mps3"),
    [
        pytest.param(27.0, 2.5, id="fast"),
        pytest.param(12.5, 3.75, id="halfway"),
        pytest.param(4.0, 5.0, id="slow"),
    ],
)
def test_braking_for_comfort_sets_in_gently(speed_mps: float, jerk_mps3: float) -> None:
    """An object that is the lead for three frames slows the car by less than 0.2 m/s."""
    lead = Cipv(1, 6.0 + 0.5 * speed_mps, 0.0, None, "")
    gentle = accelerations(EgoState(0, speed_mps), lead, 3)
    assert gentle == pytest.approx([-jerk_mps3 * 0.1 * n for n in (1, 2, 3)])
    (at_will,) = accelerations(EgoState(0, speed_mps), lead, 1, AccParams(comfort_jerk_mps3=0.0))
    assert at_will < 2.0 * gentle[-1]


def test_a_lower_set_speed_is_reached_in_comfort() -> None:
    """At 115 km/h with 100 km/h set, and nothing ahead."""
    state, given = AccState(), []
    for _ in range(30):
        state, result = control(
            state, Situation(moment(EgoState(0, 32.0), 0.1), PATH, (), None), AccParams(), EMERGENCY
        )
        assert result is not None
        given.append(result.accel_mps2)
    assert (min(given), given[0]) == (-3.5, pytest.approx(-0.25))
