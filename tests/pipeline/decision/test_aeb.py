"""A stage comes in when it is needed, not before, and stays until the danger is over."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.decision.aeb import AebState, guard
from pipeline.decision.cipv import CipvState, choose
from pipeline.decision.object_motion import describe, required_decel_mps2
from pipeline.params import AccParams, AebParams, CipvParams, MotionParams, PathParams, preset
from pipeline.path.corridor import corridor
from pipeline.types import AccCommand, Braking, Cipv, EgoState, FusedObject, Situation
from tests.pipeline.build import fused, moment

PARAMS = AebParams(margin_m=1.0, build_up_s=0.3, confirm_frames=2)
PATH = corridor(None, PathParams(half_width_m=1.5))
CRUISE = AccCommand("cruise", 20.0, 0.5, 0.25, 0.0, "nothing to slow down for")


def decide(
    *objects: FusedObject,
    speed_mps: float = 20.0,
    frames: int = 2,
    state: AebState | None = None,
    acc: AccCommand = CRUISE,
    params: AebParams = PARAMS,
) -> tuple[AebState, AccCommand]:
    ego, state = EgoState(0, speed_mps), state or AebState()
    judged, lead, _, _ = choose(CipvState(), describe(objects, ego, MotionParams()), PATH, moment(ego), CipvParams())[1]
    for _ in range(frames):
        state, command = guard(state, acc, Situation(moment(ego, 0.1), PATH, judged, lead), params, AccParams())
    assert command is not None
    return state, command


@pytest.mark.parametrize(
    ("distance_m", "closing_mps", "speed_mps", "state"),
    [
        pytest.param(80.0, 20.0, 20.0, "cruise", id="4 s away: nothing"),
        pytest.param(110.0, 27.8, 27.8, "cruise", id="100 km/h, standing car at 110 m: nothing yet"),
        pytest.param(30.0, 14.0, 14.0, "warn", id="2.1 s away, 4 m/s² needed: warning"),
        pytest.param(60.0, 20.0, 20.0, "cruise", id="3 s away and 3.8 m/s² needed: nothing"),
        pytest.param(54.0, 20.0, 20.0, "partial_brake", id="4.3 m/s² needed: partial"),
        pytest.param(43.0, 20.0, 20.0, "full_brake", id="5.6 m/s² needed: full"),
        pytest.param(5.4, 4.0, 4.0, "partial_brake", id="slow, 1.35 s away: partial by time alone"),
        pytest.param(3.4, 4.0, 4.0, "full_brake", id="slow, 0.85 s away: full"),
        pytest.param(1.0, 4.0, 4.0, "full_brake", id="nearer than any braking: full all the same"),
        pytest.param(10.0, -3.0, 20.0, "cruise", id="the lead pulls away: nothing"),
        pytest.param(3.0, 1.4, 1.3, "cruise", id="below the lowest speed: nothing"),
    ],
)
def test_stages(distance_m: float, closing_mps: float, speed_mps: float, state: str) -> None:
    _, command = decide(fused(1, distance_m, velocity=(-closing_mps, 0.0)), speed_mps=speed_mps)
    assert command.state == state


@pytest.mark.parametrize(
    ("path_sigma_m", "state"),
    [
        pytest.param(0.2, "full_brake", id="surely in our lane"),
        pytest.param(1.0, "cruise", id="before an unknown bend"),
    ],
)
def test_an_oncoming_lead_is_braked_for_only_if_it_is_surely_in_the_path(path_sigma_m: float, state: str) -> None:
    ego = EgoState(0, 15.0)
    (oncoming,) = describe([fused(1, 30.0, 0.3, velocity=(-28.0, 0.0))], ego, MotionParams())
    path = replace(PATH, profile_m=np.full(len(PATH.center), path_sigma_m))
    lead = Cipv(1, oncoming.distance_m or 0.0, 28.0, 1.1, "")
    aeb = AebState()
    for _ in range(2):
        judged = replace(choose(CipvState(), (oncoming,), PATH, moment(ego), CipvParams())[1].objects[0], in_path=True)
        aeb, command = guard(aeb, CRUISE, Situation(moment(ego, 0.1), path, (judged,), lead), PARAMS, AccParams())
    assert command is not None
    assert command.state == state


@pytest.mark.parametrize(
    ("aside_m", "reacts", "state"),
    [
        pytest.param(1.0, True, "full_brake", id="still in the path"),
        pytest.param(2.2, True, "cruise", id="beside it"),
        pytest.param(2.2, False, "full_brake", id="beside it, switched off"),
    ],
)
def test_a_lead_that_this_frame_shows_beside_the_path_is_not_braked_for(
    aside_m: float, reacts: bool, state: str
) -> None:
    """The camera had placed a parked car in the path, so it still leads when the LiDAR places it."""
    ego, now = EgoState(0, 20.0), moment(EgoState(0, 20.0), 0.1)
    params = PARAMS.model_copy(update={"react_to_present": reacts})
    at_first, then = (fused(1, x, y, velocity=(-20.0, 0.0)) for x, y in ((30.0, 0.0), (28.0, aside_m)))
    leads, _ = choose(CipvState(), describe([at_first], ego, MotionParams()), PATH, now, CipvParams())
    judged, lead, _, _ = choose(leads, describe([then], ego, MotionParams()), PATH, now, CipvParams())[1]
    assert lead is not None
    situation, aeb, command = Situation(now, PATH, judged, lead), AebState(), None
    for _ in range(2):
        aeb, command = guard(aeb, CRUISE, situation, params, AccParams())
    assert command is not None
    assert command.state == state


def test_each_stage_brakes_as_its_parameter_says_and_names_its_cause() -> None:
    _, full = decide(fused(7, 30.0, velocity=(-20.0, 0.0)))
    assert (full.accel_mps2, full.accelerator, full.brake) == (-8.0, 0.0, 1.0)
    assert "#7" in full.reason
    assert full.object_id == 7
    _, partial = decide(fused(7, 54.0, velocity=(-20.0, 0.0)))
    assert (partial.accel_mps2, partial.brake) == (-4.0, 0.5)
    _, warn = decide(fused(7, 30.0, velocity=(-14.0, 0.0)), speed_mps=14.0)
    assert (warn.accel_mps2, warn.accelerator) == (CRUISE.accel_mps2, CRUISE.accelerator), "a warning moves no pedal"


@pytest.mark.parametrize(
    ("sigma_mps", "sigmas", "state"),
    [
        pytest.param(1.0, 1.0, "partial_brake", id="known well"),
        pytest.param(6.0, 1.0, "warn", id="hardly known"),
        pytest.param(6.0, 0.0, "partial_brake", id="hardly known, switched off"),
    ],
)
def test_the_camera_brakes_for_a_speed_that_it_knows(sigma_mps: float, sigmas: float, state: str) -> None:
    boxed = replace(fused(1, 25.0, source="V", velocity=(-14.0, 0.0), hits=20), camera_ranges=20)
    boxed = replace(boxed, camera_speed_sigma_mps=sigma_mps, existence=0.98, height_from="range")
    params = PARAMS.model_copy(update={"closing_sigmas": sigmas})
    _, command = decide(replace(boxed, justifies=Braking.FULL), speed_mps=14.0, params=params)
    assert command.state == state


def test_the_stronger_demand_wins() -> None:
    hard = AccCommand("follow", 5.0, -6.0, 0.0, 0.75, "inside the desired gap")
    assert decide(fused(1, 54.0, velocity=(-20.0, 0.0)), acc=hard)[1] == hard
    assert decide(fused(1, 30.0, velocity=(-20.0, 0.0)), acc=hard)[1].state == "full_brake"


def test_one_frame_is_not_enough() -> None:
    near = fused(1, 20.0, velocity=(-20.0, 0.0))
    assert decide(near, frames=1)[1] == CRUISE
    assert decide(near, frames=2)[1].state == "full_brake"


@pytest.mark.parametrize(
    ("other", "state"),
    [
        pytest.param(fused(1, 20.0, 3.5, velocity=(-20.0, 0.0)), "cruise", id="standing in the next lane"),
        pytest.param(fused(1, 20.0, 3.5, velocity=(-20.0, -3.0)), "full_brake", id="on its way into our lane"),
        pytest.param(fused(1, 20.0, 0.0, "L", (-20.0, 0.0), hits=2), "cruise", id="one sensor, not confirmed"),
        pytest.param(fused(1, 20.0, 0.0, "L", (-20.0, 0.0), hits=3), "full_brake", id="one sensor, confirmed"),
        pytest.param(fused(1, 20.0, 0.0, "L", (-20.0, 0.0), height=0.2), "cruise", id="a kerb"),
        pytest.param(
            fused(1, 30.0, 0.0, "V", (-20.0, 0.0)), "partial_brake", id="a box height alone never brakes fully"
        ),
        pytest.param(
            fused(1, 20.0, 0.0, "V", (-20.0, 0.0)), "warn", id="a box height that asks for more than tyres can do"
        ),
    ],
)
def test_whom_it_brakes_for(other: FusedObject, state: str) -> None:
    assert decide(other)[1].state == state


def test_braking_stays_until_the_danger_is_over() -> None:
    state, _ = decide(fused(1, 30.0, velocity=(-20.0, 0.0)))
    eased = fused(1, 25.0, velocity=(-6.0, 0.0))
    state, command = decide(eased, state=state, frames=5)
    assert command.state == "full_brake", "2 m/s² would do now, but half the speed is still to go"
    opening = fused(1, 20.0, velocity=(1.0, 0.0))
    assert decide(opening, state=state, frames=2)[1].state == "full_brake"
    assert decide(opening, state=state, frames=3)[1] == CRUISE


def test_a_threat_that_vanishes_is_braked_for_a_little_longer() -> None:
    state, _ = decide(fused(1, 30.0, velocity=(-20.0, 0.0)))
    held = decide(state=state, frames=2)[1]
    assert (held.state, held.object_id) == ("full_brake", 1)
    assert decide(state=state, frames=3)[1] == CRUISE


@pytest.mark.parametrize(
    ("farther_m", "state"),
    [
        pytest.param(1.5, "full_brake", id="the same vehicle under a new id"),
        pytest.param(-3.0, "full_brake", id="something nearer"),
        pytest.param(4.0, "cruise", id="the vehicle beyond, which needs 0.5 m/s²"),
    ],
)
def test_what_holds_the_brakes_once_their_cause_is_gone(farther_m: float, state: str) -> None:
    aeb, _ = decide(fused(1, 4.0, velocity=(-5.0, 0.0)), speed_mps=5.0)
    for tick in range(1, 5):
        other = fused(2, 4.0 + farther_m - 0.2 * tick, velocity=(-2.0, 0.0))
        aeb, command = decide(other, speed_mps=5.0, frames=1, state=replace(aeb, closing_mps=2.0))
    assert command.state == state


def test_at_standstill_the_brakes_hold() -> None:
    state, _ = decide(fused(1, 10.0, velocity=(-20.0, 0.0)))
    standing = fused(1, 1.5, velocity=(0.0, 0.0))
    assert decide(standing, state=state, speed_mps=0.0, frames=19)[1].state == "full_brake"
    assert decide(standing, state=state, speed_mps=0.0, frames=21)[1] == CRUISE


def test_switched_off_it_changes_nothing() -> None:
    assert preset("default").aeb.enabled
    assert not preset("paper").aeb.enabled
    off = AebParams(enabled=False)
    assert decide(fused(1, 10.0, velocity=(-20.0, 0.0)), params=off) == (AebState(), CRUISE)


def test_without_ego_speed_there_is_no_command() -> None:
    assert guard(AebState(2), None, Situation(moment(None, 0.1), PATH, (), None), PARAMS, AccParams()) == (
        AebState(),
        None,
    )


@given(st.floats(2.0, 150.0), st.floats(0.1, 60.0))
def test_braking_as_required_leaves_the_margin(distance_m: float, closing_mps: float) -> None:
    required = required_decel_mps2(distance_m, closing_mps, PARAMS)
    if required == inf:
        assert distance_m - PARAMS.margin_m - closing_mps * PARAMS.build_up_s <= 0.1 + 1e-9
        return
    left = distance_m - closing_mps * PARAMS.build_up_s - closing_mps**2 / (2 * required)
    assert left == pytest.approx(PARAMS.margin_m, abs=1e-6)


@given(st.floats(0.5, 150.0), st.floats(0.5, 149.0), st.floats(0.0, 60.0))
def test_nearer_never_needs_less(distance_m: float, nearer_by_m: float, closing_mps: float) -> None:
    far = required_decel_mps2(distance_m, closing_mps, PARAMS)
    assert required_decel_mps2(distance_m - nearer_by_m, closing_mps, PARAMS) >= far
