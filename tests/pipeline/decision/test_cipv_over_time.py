"""Who leads is decided over time, and who leads next is told before."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.decision.cipv import Choice, CipvState, choose
from pipeline.decision.object_motion import describe
from pipeline.params import MotionParams
from pipeline.types import EgoState, FusedObject
from tests.pipeline.build import fused, moment
from tests.pipeline.decision.choosing import PARAMS, PATH, decide, over_time


def test_a_decoy_whose_place_sways_does_not_take_over() -> None:
    """A box in the next lane, twice in ten frames measured inside the path."""
    lead = fused(1, 40.0, source="V")
    offsets = [3.2, 2.9, 3.3, 1.0, 3.1, 2.8, 1.2, 3.4, 3.0, 3.2]
    choices = over_time([(lead, dataclasses.replace(fused(2, 32.0, y, source="V"))) for y in offsets])
    assert {choice.lead.id for choice in choices if choice.lead} == {1}


def test_one_that_moves_over_is_told_before_and_leads_when_it_is_in() -> None:
    """A car 25 m ahead, 3.5 m to the side, moves over at 1.2 m/s; its wheel is on the edge when its centre is at 2.4
    m."""
    frames = []
    for k in range(40):
        y = max(3.5 - 0.12 * k, 0.0)
        frames.append((fused(1, 40.0), fused(2, 25.0, y, velocity=(-1.0, -1.2 if y else 0.0))))
    choices = over_time(frames, ego=EgoState(0, 20.0, 0.0))
    on_the_edge = next(k for k in range(40) if 3.5 - 0.12 * k <= 2.4)
    told = next(k for k, choice in enumerate(choices) if choice.next_lead and choice.next_lead.id == 2)
    leads = next(k for k, choice in enumerate(choices) if choice.lead and choice.lead.id == 2)
    assert told < on_the_edge < leads < on_the_edge + 12
    assert choices[told].next_lead.reason.startswith("cutting in: enters the path in ")  # type: ignore[union-attr]
    assert all(2 in ids(choice) for choice in choices[told:]), "from then on it is one of the two"
    assert choices[-1].next_lead is not None
    assert choices[-1].next_lead.reason == "next behind #2"


def test_a_lead_that_leaves_names_the_one_behind_it() -> None:
    leaving = fused(1, 20.0, 0.8, velocity=(0.0, 1.5))
    (choice,) = over_time([(leaving, fused(2, 40.0))], ego=EgoState(0, 20.0, 0.0))
    assert choice.lead is not None
    assert choice.next_lead is not None
    assert (choice.lead.id, choice.next_lead.id) == (1, 2)
    assert choice.next_lead.reason == "#1 leaves the path in 0.7 s"


def test_nobody_beside_is_next() -> None:
    (choice,) = over_time([(fused(2, 25.0, 3.5, velocity=(-1.0, 0.0)), fused(3, 15.0, 2.6, label="person"))])
    assert choice.lead is None
    assert choice.next_lead is None


def test_where_the_path_is_not_known_nobody_new_leads() -> None:
    vague = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), 5.0))
    (item,), lead, _, (why,) = choose(CipvState(), (fused(1, 40.0),), vague, moment(), PARAMS)[1]
    assert lead is None
    assert why.reason == "lateral position uncertain by 5.0 m"
    assert item.in_path
    assert item.in_path_probability == pytest.approx(0.51, abs=0.01)
    assert choose(CipvState(1), (fused(1, 40.0),), vague, moment(), PARAMS)[1].lead is not None, "who led may stay"
    unusable = dataclasses.replace(PATH, usable=False, profile_m=np.full(len(PATH.center), 1.5))
    assert choose(CipvState(), (fused(1, 40.0),), unusable, moment(), PARAMS)[1].lead is None


def ids(choice: Choice) -> set[int]:
    return {lead.id for lead in (choice.lead, choice.next_lead) if lead is not None}


def sightings(*places: FusedObject) -> list[Choice]:
    """The choice in each frame while one object is seen at these positions every 0.1 s, from a car at 20 m/s."""
    state, ego, found = CipvState(), EgoState(0, 20.0, 0.0), []
    for item in places:
        seen = describe([item], ego, MotionParams())
        state, choice = choose(state, tuple(seen), PATH, moment(ego, 0.1), PARAMS)
        found.append(choice)
    return found


@given(st.lists(st.floats(-4.0, 4.0), min_size=1, max_size=8))
def test_the_gates_value_and_limit_say_what_it_decides(asides: list[float]) -> None:
    """Regardless of earlier positions, a value over the limit means out, and the odds agree."""
    for choice in sightings(*[fused(1, 20.0, y) for y in asides]):
        gates = {gate.name: gate for gate in choice.objects[0].gates}
        offset = gates["path_offset"]
        assert offset.value is not None
        assert offset.passed == choice.objects[0].in_path
        assert offset.value <= offset.limit + 1e-9 if offset.passed else offset.value >= offset.limit - 1e-9


def test_what_falls_behind_the_bumper_fails_for_that_alone() -> None:
    """Its offset permits leading, and the gate says so."""
    (item,) = sightings(*[fused(1, 6.0, 0.2)] * 6, fused(1, -6.0, 0.2))[-1].objects
    assert not item.in_path
    assert [gate.name for gate in item.gates if not gate.passed] == ["ahead"]


@pytest.mark.parametrize(
    ("what", "path_sigma_m", "stays_with", "leads"),
    [
        ("a bend begins, and the path does not know it yet", 5.0, 0.05, True),
        ("the same, with what other leads need", 5.0, 0.4, False),
        ("it takes an exit, beside lines", 0.3, 0.05, False),
    ],
)
def test_a_lead_that_was_seen_to_drive_keeps_its_lane(
    what: str, path_sigma_m: float, stays_with: float, leads: bool
) -> None:
    """It is followed for two seconds on a path known to 0.3 m, and is then 3.5 m beside the middle of the path."""
    params = PARAMS.model_copy(update={"stay_driving": stays_with})
    ego, state, choice = EgoState(0, 12.0, 0.0), CipvState(), None
    for k in range(40):
        item = dataclasses.replace(fused(1, 40.0, 0.0 if k < 20 else 3.5, velocity=(0.0, 0.0)), ranged_steady=20)
        sigma_m = 0.3 if k < 20 else path_sigma_m
        path = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), sigma_m))
        state, choice = choose(state, describe([item], ego, MotionParams()), path, moment(ego, 0.1), params)
        assert k >= 20 or k < 3 or choice.lead is not None
    assert choice is not None
    assert (choice.lead is not None) is leads, what


@pytest.mark.parametrize(
    ("offset_m", "stays"), [(0.0, True), (1.3, False)], ids=["it was in our lane", "it may have been in the next one"]
)
def test_a_lead_keeps_only_a_lane_that_surely_was_ours(offset_m: float, stays: bool) -> None:
    """Followed for two seconds on a path known to a metre, it is then 3.5 m beside one known to five."""
    ego, state, leads, probable = EgoState(0, 12.0, 0.0), CipvState(), [], []
    for k in range(40):
        item = dataclasses.replace(fused(1, 40.0, offset_m if k < 20 else 3.5, velocity=(0.0, 0.0)), ranged_steady=20)
        path = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), 1.0 if k < 20 else 5.0))
        state, choice = choose(state, describe([item], ego, MotionParams()), path, moment(ego, 0.1), PARAMS)
        leads.append(choice.lead is not None)
        probable.append(choice.objects[0].in_path_probability or 0.0)
    assert all(leads[3:20]), "it leads in either case"
    assert (max(probable) > 0.9) is stays
    assert leads[-1] is stays


def test_what_crosses_fast_is_judged_where_it_is_now() -> None:
    """A car crosses from the right at 6 m/s: it leads from the first frame on in which 0.9 m of it, its nose included,
    are inside, and not in the first in which they are not. One that is there at a
    bound is believed after a while."""
    crossing = [fused(1, 20.0, -4.1 + 0.6 * k, velocity=(-10.0, 6.0)) for k in range(14)]
    inside = [choice.lead is not None for choice in sightings(*crossing)]
    assert inside == [-2.4 < -4.1 + 0.6 * k < 1.5 for k in range(14)]
    swaying = [fused(1, 20.0, -3.0), fused(1, 20.0, -3.0), fused(1, 20.0, 0.0)]
    assert sightings(*swaying)[-1].lead is None


def test_the_lidar_has_just_lost_what_the_camera_sees() -> None:
    """It may become the lead while its tracked distance is accurate, but not after it has drifted."""
    lost = dataclasses.replace(fused(1, 20.0), seen_by="V", measured=False)
    assert decide(dataclasses.replace(lost, distance_sigma_m=0.2))[0] is not None
    lead, why_not = decide(dataclasses.replace(lost, distance_sigma_m=0.8))
    assert lead is None
    assert why_not == {1: "distance not measured in this frame"}


@pytest.mark.parametrize(
    ("case", "sigma_m", "at_m", "leads"),
    [
        ("the path is known", 0.5, 60.0, True),
        ("as likely beside it", 3.5, 60.0, False),
        ("near, though beside the middle", 0.5, 20.0, True),
    ],
)
def test_a_new_lead_is_rather_in_the_path_than_not(case: str, sigma_m: float, at_m: float, leads: bool) -> None:
    vague = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), sigma_m))
    objects = (fused(1, at_m, 0.3),)
    assert (choose(CipvState(), objects, vague, moment(), PARAMS)[1].lead is not None) == leads, case
    led = choose(CipvState(1), objects, vague, moment(), PARAMS)[1].lead
    assert led is not None, "it was in the path when that was known"
