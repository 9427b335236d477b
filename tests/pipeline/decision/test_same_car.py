"""One car as two objects: which of them leads, and that its number stays."""

from __future__ import annotations

import dataclasses

import pytest

from pipeline.decision.cipv import CipvState
from pipeline.decision.same_car import Rival
from pipeline.types import FusedObject
from tests.pipeline.build import fused
from tests.pipeline.decision.choosing import PARAMS, chosen, decide, over_time


@pytest.mark.parametrize(
    ("doubtful", "surer"),
    [
        pytest.param(
            dataclasses.replace(fused(1, 20.0, source="V"), distance_sigma_m=2.0),
            fused(2, 22.8),
            id="box and cluster of one car",
        ),
        pytest.param(
            dataclasses.replace(fused(1, 21.5), seen_by="", distance_sigma_m=0.6),
            fused(2, 22.8),
            id="lost and found again",
        ),
    ],
)
def test_a_doubtful_view_yields_to_the_surer_one_it_agrees_with(doubtful: FusedObject, surer: FusedObject) -> None:
    before = CipvState(1, rival=Rival(2, PARAMS.confirm_hits - 1))
    lead, why_not = chosen(before, doubtful, surer)
    assert lead is not None
    assert lead.id == 2
    assert why_not == {1: "probably the same object as #2, which is better measured"}


def test_the_lead_keeps_its_number_while_another_view_of_it_is_better_for_a_frame_or_two() -> None:
    """Its box and its cluster are two objects for a while, or it is missed: whichever is nearer or better measured."""
    box = dataclasses.replace(fused(1, 20.0, source="V"), distance_sigma_m=2.0)
    unseen = dataclasses.replace(fused(1, 20.0), seen_by="", distance_sigma_m=0.6)
    for other, lead in ((fused(2, 22.8), box), (fused(2, 21.0), unseen), (fused(2, 19.5), fused(1, 20.0))):
        both, alone = (lead, other), (fused(1, 20.0),)
        choices = over_time([alone, both, both, alone, both, both, both, both])
        assert [choice.lead and choice.lead.id for choice in choices] == [1, 1, 1, 1, 1, 1, 2, 2]


def test_a_car_that_cuts_in_is_no_other_view_of_the_lead() -> None:
    choices = over_time([(fused(1, 40.0),), (fused(1, 40.0), fused(2, 30.0))])
    assert choices[1].lead is not None
    assert choices[1].lead.id == 2


def test_what_is_twice_as_far_away_is_no_better_view_of_the_lead() -> None:
    """However uncertain its distance is: the car at 35 m is missed for a frame."""
    missed = dataclasses.replace(fused(1, 35.0), seen_by="", distance_sigma_m=0.3)
    lead, _ = decide(missed, dataclasses.replace(fused(2, 69.0, source="V"), distance_sigma_m=15.0), last=1)
    assert lead is not None
    assert lead.id == 1
