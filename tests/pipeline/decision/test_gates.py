"""Decisions read typed conditions; gates only show them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.decision import gates
from pipeline.decision.acc import AccState, control
from pipeline.decision.aeb import AebState, find_threats, guard
from pipeline.decision.cipv import Choice, CipvState, choose
from pipeline.decision.object_motion import describe
from pipeline.fusion.last_place import LastPlace
from pipeline.params import AccParams, AebParams, CipvParams, MotionParams, PathParams
from pipeline.path.corridor import corridor
from pipeline.types import AccCommand, Conditions, EgoState, FusedObject, Gate, ObjectSource, Situation
from tests.pipeline.build import fused, moment

EGO = EgoState(0, 15.0, 0.0)
PATH = corridor(EGO, PathParams(half_width_m=1.5))
SCENES = {
    "a lead, one cuts in, one stands aside": (
        fused(1, 30.0, velocity=(-5.0, 0.0)),
        fused(2, 20.0, 2.6, velocity=(-1.0, -2.0)),
        fused(3, 25.0, -4.0),
        fused(4, 12.0, 0.2, source="L", height=0.2),
    ),
    "one crosses whose class is no vehicle's": (fused(1, 14.0, 3.0, label="person", velocity=(-15.0, -4.0)),),
    "one comes into the path, seen once": (fused(1, 14.0, 3.0, source="L", hits=1, velocity=(-15.0, -4.0)),),
    "a carried one": (fused(1, 10.0, velocity=(-15.0, 0.0)), fused(2, 14.0, 2.8, hits=9, velocity=(-15.0, -4.0))),
}


def decide(objects: tuple[FusedObject, ...]) -> tuple[Choice, Situation, list[AccCommand | None]]:
    seen = describe(objects, EGO, MotionParams())
    state, now = CipvState(), moment(EGO, 0.1)
    state, choice = choose(state, seen, PATH, now, CipvParams())
    situation = Situation(now, PATH, choice.objects, choice.lead)
    commands, acc_state, aeb_state = [], AccState(), AebState()
    for _ in range(3):
        acc_state, command = control(acc_state, situation, AccParams(), AebParams())
        aeb_state, command = guard(aeb_state, command, situation, AebParams(), AccParams())
        commands.append(command)
    return choice, situation, commands


@pytest.mark.parametrize("objects", SCENES.values(), ids=SCENES.keys())
def test_decisions_stay_when_every_shown_gate_has_another_name(
    objects: tuple[FusedObject, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    choice, situation, commands = decide(objects)
    renamed = Conditions(*[each._replace(shown_as=f"renamed {n}") for n, each in enumerate(gates.CONDITIONS)])
    monkeypatch.setattr(gates, "CONDITIONS", renamed)
    other, situation_then, commands_then = decide(objects)

    assert {gate.name for item in other.objects for gate in item.gates} == {each.shown_as for each in renamed}
    assert (other.lead, other.next_lead, other.rejected) == (choice.lead, choice.next_lead, choice.rejected)
    assert commands_then == commands
    assert find_threats(situation_then, AebParams()) == find_threats(situation, AebParams())


def test_the_scenes_ask_for_braking_and_for_a_next_lead() -> None:
    """Otherwise the test above would compare nothing."""
    cuts_in, _, _ = decide(SCENES["a lead, one cuts in, one stands aside"])
    assert cuts_in.lead is not None
    assert cuts_in.next_lead is not None
    assert cuts_in.next_lead.reason.startswith("cutting in")
    _, _, crossing = decide(SCENES["one crosses whose class is no vehicle's"])
    assert crossing[-1] is not None
    assert crossing[-1].state == "full_brake"


def test_gates_show_the_same_answers_that_eligibility_holds() -> None:
    choice, _, _ = decide(SCENES["a lead, one cuts in, one stands aside"])
    for item in choice.objects:
        assert item.eligibility is not None
        assert tuple(gate.passed for gate in item.gates) == item.eligibility


def test_an_object_that_was_not_judged_starts_no_reaction() -> None:
    """Whatever its gates say."""
    shown = tuple(Gate(each.shown_as, None, 1.0, True) for each in gates.CONDITIONS)
    item = dataclasses.replace(fused(1, 20.0), gates=shown)
    assert not gates.is_solid(item)


@pytest.mark.parametrize(
    ("existence", "offset_m", "leads", "why_not"),
    [
        pytest.param(0.98, 0.0, True, None, id="surely there and in the path"),
        pytest.param(0.65, 0.0, False, "only 65 % likely to exist", id="a weak box"),
        pytest.param(0.98, 1.45, True, None, id="surely there, at the edge"),
        pytest.param(0.75, 1.45, False, "likely to exist and be in path", id="barely there, and at the edge"),
    ],
)
def test_a_new_lead_has_to_be_probable_as_a_whole(
    existence: float, offset_m: float, leads: bool, why_not: str | None
) -> None:
    item = dataclasses.replace(fused(1, 30.0, offset_m), existence=existence, distance_sigma_m=0.2)
    choice, _, _ = decide((item,))
    assert (choice.lead is not None) == leads
    assert all(why_not is not None and why_not in each.reason for each in choice.rejected)
    assert len(choice.rejected) == (0 if leads else 1)


@pytest.mark.parametrize(("speed_mps", "leads"), [(0.0, False), (9.0, True), (-9.0, False), (None, True)])
def test_at_the_edge_only_what_goes_along_leads(speed_mps: float | None, leads: bool) -> None:
    """In the path with a probability of 51 %, like every parked or oncoming car in a bend of uncertain shape."""
    vague = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), 1.5))
    item = dataclasses.replace(fused(1, 30.0, 1.2), existence=0.98)
    velocity = None if speed_mps is None else (speed_mps - EGO.speed_mps, 0.0)
    (known,) = describe((dataclasses.replace(item, velocity_mps=velocity),), EGO, MotionParams())
    choice = choose(CipvState(), (known,), vague, moment(EGO, 0.1), CipvParams())[1]
    assert (choice.lead is not None) == leads
    centred = dataclasses.replace(known, **fused_place(30.0, 0.0))
    sure = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), 0.3))
    assert choose(CipvState(), (centred,), sure, moment(EGO, 0.1), CipvParams())[1].lead is not None


@pytest.mark.parametrize(
    ("source", "ego", "leads"),
    [
        pytest.param("VL", EGO, True, id="a car that drives ahead"),
        pytest.param("L", EGO, False, id="a wall that comes into view bit by bit"),
        pytest.param("L", None, True, id="ego motion is not known"),
    ],
)
def test_what_seems_to_move_and_has_no_class_must_surely_be_in_the_path(
    source: ObjectSource, ego: EgoState | None, leads: bool
) -> None:
    """In the path with a probability of 65 %."""
    path = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), 1.5))
    item = dataclasses.replace(fused(1, 30.0, 0.6, source=source, velocity=(-5.0, 0.0)), existence=0.98)
    (seen,) = describe([item], ego, MotionParams())
    choice = choose(CipvState(), (seen,), path, moment(ego), CipvParams())[1]
    assert (choice.lead is not None) == leads


def fused_place(x: float, y: float) -> dict[str, object]:
    """The position fields of a vehicle, to be copied to another one."""
    there = fused(1, x, y)
    return {name: getattr(there, name) for name in ("bev", "cuboid", "closest_point", "distance_m")}


@pytest.mark.parametrize(
    ("sigma", "leads"),
    [
        pytest.param(5.0, False, id="what may stand must be in the path as surely as what stands"),
        pytest.param(1.0, True, id="what surely drives need not"),
    ],
)
def test_a_speed_that_is_mostly_noise_makes_no_traffic(sigma: float, leads: bool) -> None:
    """A camera-only car at the edge of the path, in it with a probability of 60 %, that seems to drive away at 8
    m/s."""
    item = fused(1, 40.0, 1.1, source="V", velocity=(8.0 - 15.0, 0.0), length=4.3)
    seen = dataclasses.replace(item, camera_speed_sigma_mps=sigma, distance_sigma_m=2.0)
    path = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), 1.2))
    (moving,) = describe([seen], EGO, MotionParams())
    state, choice = CipvState(), None
    for _ in range(3):
        state, choice = choose(state, (moving,), path, moment(EGO, 0.1), CipvParams(become_camera=0.0))
    assert choice is not None
    (judged,) = choice.objects
    assert (judged.in_path_probability or 0.0) > 0.5
    assert (choice.lead is not None) is leads


@pytest.mark.parametrize(
    ("driving_s", "leads"),
    [
        pytest.param(0.3, False, id="parked: it only seemed to drive while it came into view"),
        pytest.param(2.0, True, id="it stopped in front of us"),
    ],
)
def test_a_lead_that_proves_to_stand_at_the_edge_leads_only_if_it_has_driven(driving_s: float, leads: bool) -> None:
    """In the path with a probability of 51 to 59 %."""
    vague = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), 1.5))
    state, choice = CipvState(), None
    for tick in range(40):
        speed_mps = 5.0 if tick < 10 * driving_s else 0.0
        item = fused(1, 20.0, 1.2, velocity=(speed_mps - EGO.speed_mps, 0.0))
        (seen,) = describe((dataclasses.replace(item, existence=0.98),), EGO, MotionParams())
        state, choice = choose(state, (seen,), vague, moment(EGO, 0.1), CipvParams())
        assert choice.lead is not None or tick >= 10 * driving_s, "while it drives, it leads"
    assert choice is not None
    assert (choice.lead is not None) is leads


@pytest.mark.parametrize(
    ("source", "aside_m", "becomes"),
    [
        pytest.param("V", 1.2, False, id="by camera, at the edge: a track that hops along parked cars"),
        pytest.param("VL", 1.2, True, id="the same by the LiDAR"),
        pytest.param("V", 0.0, True, id="straight ahead on a road that is not known"),
    ],
)
def test_what_only_the_camera_sees_at_the_edge_must_surely_be_in_the_path(
    source: ObjectSource, aside_m: float, becomes: bool
) -> None:
    """It drives ahead, in the path with a probability of more than 50 %, at its edge of less than 70 %."""
    vague = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), 1.5))
    item = fused(1, 30.0, aside_m, source=source, velocity=(9.0 - EGO.speed_mps, 0.0))
    (seen,) = describe((dataclasses.replace(item, existence=0.98),), EGO, MotionParams())
    for state, expected in (
        (CipvState(), becomes),
        (CipvState(1, {1: 0.2}, {1: LastPlace(5, None, 0.0, ranged=False)}), True),
    ):
        choice = choose(state, (seen,), vague, moment(EGO, 0.1), CipvParams())[1]
        assert 0.5 < (choice.objects[0].in_path_probability or 0.0) < (0.7 if aside_m else 0.98)
        assert (choice.lead is not None) is expected
