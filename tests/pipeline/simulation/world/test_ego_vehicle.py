"""How the pedals move the car: in words, signs and limits."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.fast_replace import evolve
from pipeline.simulation.world.actors import Motion
from pipeline.simulation.world.ego_vehicle import (
    GRAVITY_MPS2,
    Pedals,
    VehicleModel,
    VehicleState,
    advance,
    command,
)

MODEL = VehicleModel()
LANE = Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
DT_S = 0.005


def drive(
    state: VehicleState, pedals: Pedals, seconds: float, lane: Motion = LANE, curvature: float = 0.0
) -> list[VehicleState]:
    state = command(state, pedals, MODEL)
    states = [state]
    for _ in range(round(seconds / DT_S)):
        state = advance(state, lane, curvature, DT_S, MODEL)
        states.append(state)
    return states


def at_speed(speed_mps: float) -> VehicleState:
    return VehicleState(0.0, 0.0, speed_mps, 0.0, 0.0)


def test_nothing_happens_before_the_dead_time() -> None:
    states = drive(at_speed(20.0), Pedals(brake=1.0), MODEL.dead_time_s)
    assert {state.speed_mps for state in states} == {20.0}
    assert drive(at_speed(20.0), Pedals(brake=1.0), MODEL.dead_time_s + 0.05)[-1].speed_mps < 20.0


@pytest.mark.parametrize(
    ("pedals", "accel_mps2"),
    [
        pytest.param(Pedals(brake=1.0), -8.0, id="brake pedal at 1"),
        pytest.param(Pedals(brake=0.5), -4.0, id="half the brake pedal"),
        pytest.param(Pedals(accelerator=1.0), 2.0, id="accelerator at 1"),
        pytest.param(Pedals(), 0.0, id="no pedal: the speed stays"),
        pytest.param(Pedals(1.0, 0.25), -2.0, id="both pedals: the brake wins"),
    ],
)
def test_pedals_are_scaled(pedals: Pedals, accel_mps2: float) -> None:
    assert drive(at_speed(30.0), pedals, 2.0)[-1].accel_mps2 == pytest.approx(accel_mps2, abs=0.02)


def test_brakes_build_up_no_faster_than_their_jerk() -> None:
    states = drive(at_speed(30.0), Pedals(brake=1.0), 1.0)
    jerks = [(b.accel_mps2 - a.accel_mps2) / DT_S for a, b in pairwise(states)]
    assert min(jerks) == pytest.approx(-MODEL.brake_jerk_mps3)


def test_the_road_gives_no_more_than_its_friction() -> None:
    wet = evolve(MODEL, friction=0.4)
    state = command(at_speed(30.0), Pedals(brake=1.0), wet)
    for _ in range(400):
        state = advance(state, LANE, 0.0, DT_S, wet)
    assert state.accel_mps2 == pytest.approx(-0.4 * GRAVITY_MPS2)


def test_in_a_curve_less_is_left_for_the_brakes() -> None:
    straight = drive(at_speed(30.0), Pedals(brake=1.0), 0.8)[-1]
    curve = drive(at_speed(30.0), Pedals(brake=1.0), 0.8, curvature=1 / 130)[-1]
    assert curve.accel_mps2 > straight.accel_mps2 + 0.8


def test_it_stops_stays_and_the_way_is_what_the_speed_says() -> None:
    states = drive(at_speed(10.0), Pedals(brake=1.0), 3.0)
    assert states[-1].speed_mps == 0.0
    assert states[-1].travelled_m == pytest.approx(sum(state.speed_mps for state in states) * DT_S, abs=0.05)
    assert states[-1].travelled_m == states[-50].travelled_m
    ideal = 10.0 * MODEL.dead_time_s + 10.0**2 / (2 * 8.0)
    assert ideal < states[-1].travelled_m < ideal + 10.0 * 0.35


@given(st.floats(0.0, 60.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(-0.02, 0.02))
def test_never_backwards_never_beyond_the_tyres(speed: float, throttle: float, brake: float, curvature: float) -> None:
    for state in drive(at_speed(speed), Pedals(throttle, brake), 0.5, curvature=curvature):
        assert state.speed_mps >= 0.0
        assert abs(state.accel_mps2) <= MODEL.friction * GRAVITY_MPS2 + 1e-9


def test_the_driver_steers_to_the_lane_and_not_at_standstill() -> None:
    left = evolve(LANE, d_m=3.5)
    assert drive(at_speed(20.0), Pedals(), 6.0, lane=left)[-1].d_m == pytest.approx(3.5, abs=0.02)
    assert drive(at_speed(0.0), Pedals(), 6.0, lane=left)[-1].d_m == 0.0
