"""The next lead cuts in only if it surely does."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from pipeline.decision.cipv import Choice, CipvState, choose
from pipeline.decision.object_motion import describe
from pipeline.params import CipvParams, MotionParams
from pipeline.types import EgoState, FusedObject, ObjectSource, Path
from tests.pipeline.build import fused, moment
from tests.pipeline.decision.choosing import PATH

EGO_MPS = 20.0


def beside(
    source: ObjectSource = "VL", forward_mps: float = 19.0, sideways_mps: float = -1.4, **known: Any
) -> FusedObject:
    """A car 25 m ahead in the next lane on the left. forward_mps, sideways_mps: over ground."""
    item = fused(2, 25.0, 3.2, source=source, velocity=(forward_mps - EGO_MPS, sideways_mps), hits=20)
    return dataclasses.replace(item, **{"rigid_mps": None if source == "V" else 0.7 * sideways_mps} | known)


def chosen(item: FusedObject, ego_mps: float | None, path: Path = PATH, params: CipvParams | None = None) -> Choice:
    ego = EgoState(0, ego_mps, 0.0) if ego_mps is not None else None
    (seen,) = describe([item], ego, MotionParams(), 0.1)
    return choose(CipvState(), (seen,), path, moment(ego, 0.1), params or CipvParams())[1]


@pytest.mark.parametrize(
    ("item", "ego_mps", "is_next"),
    [
        pytest.param(beside(), EGO_MPS, True, id="changes into our lane"),
        pytest.param(beside("L"), EGO_MPS, True, id="seen by the LiDAR alone"),
        pytest.param(beside("V"), EGO_MPS, True, id="seen by the camera alone"),
        pytest.param(beside(sideways_mps=-0.4), EGO_MPS, False, id="sways in its lane"),
        pytest.param(beside(sideways_mps=1.4), EGO_MPS, False, id="moves away"),
        pytest.param(beside(forward_mps=0.0, sideways_mps=0.0), EGO_MPS, False, id="parked"),
        pytest.param(
            beside(rigid_mps=0.0), EGO_MPS, False, id="only one of its sides moves: more of it comes into view"
        ),
        pytest.param(beside(ranged_steady=1), EGO_MPS, False, id="the LiDAR has just found it"),
        pytest.param(beside("L", ranged_steady=3, forward_mps=2.0), EGO_MPS, False, id="a hedge, too briefly seen"),
        pytest.param(beside(forward_mps=-15.0), EGO_MPS, False, id="oncoming, before a bend"),
        pytest.param(beside("V", camera_ranges=4), EGO_MPS, False, id="four boxes of a far car"),
        pytest.param(beside("V", camera_speed_sigma_mps=10.0), EGO_MPS, False, id="the camera does not know its speed"),
        pytest.param(beside("V", boxed_share=0.3), EGO_MPS, False, id="boxes in few images: hops along parked cars"),
        pytest.param(beside(existence=0.4), EGO_MPS, False, id="may not exist"),
        pytest.param(beside(), None, True, id="own speed unknown, both sensors see a car"),
        pytest.param(beside("L"), None, False, id="own speed unknown, seen by the LiDAR alone: we may turn"),
        pytest.param(beside("V"), None, False, id="own speed unknown, seen by the camera alone"),
    ],
)
def test_who_cuts_in(item: FusedObject, ego_mps: float | None, is_next: bool) -> None:
    choice = chosen(item, ego_mps)
    assert choice.lead is None
    assert (choice.next_lead is not None) is is_next
    if choice.next_lead is not None:
        assert choice.next_lead.reason.startswith("cutting in: enters the path in ")


def test_nobody_cuts_into_a_path_that_is_not_known() -> None:
    vague = dataclasses.replace(PATH, profile_m=np.full(len(PATH.center), 5.0))
    assert chosen(beside(), EGO_MPS, vague).next_lead is None


@pytest.mark.parametrize(
    "item",
    [beside(ranged_steady=1), beside(forward_mps=-15.0), beside("V", camera_ranges=4), beside(existence=0.4)],
    ids=["just found", "oncoming", "few boxes", "may not exist"],
)
def test_without_proof_a_lateral_speed_is_enough(item: FusedObject) -> None:
    """What preset ``paper`` does."""
    choice = chosen(item, EGO_MPS, params=CipvParams(prove_cut_in=False))
    assert choice.next_lead is not None


def test_a_nearer_lead_is_not_followed_by_what_cuts_in_behind_it() -> None:
    ego = EgoState(0, EGO_MPS, 0.0)
    items = describe([fused(1, 15.0), beside()], ego, MotionParams(), 0.1)
    choice = choose(CipvState(), tuple(items), PATH, moment(ego, 0.1), CipvParams())[1]
    assert choice.lead is not None
    assert choice.lead.id == 1
    assert choice.next_lead is None
