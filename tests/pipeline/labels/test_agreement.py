"""How far two people agree."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.labels.agreement import agreement
from pipeline.labels.model import LabelSet, LabelTrack, Lead, LeadRange, Sighting, State
from tests.pipeline.labels.formats.sets import IMPORT, drive


def car(number: int, x: float, label: str = "car", state: State = "accepted", yaw_rad: float = 0.0) -> LabelTrack:
    cuboid = Cuboid((x, 0.0, 0.7), (4.0, 2.0, 1.5), yaw_rad)
    return LabelTrack(number, label, (Sighting(0, cuboid), Sighting(1, cuboid)), state, IMPORT)


def said(*tracks: LabelTrack, lead: Lead | None = None) -> LabelSet:
    leads = (LeadRange(0, 1, lead, "accepted", IMPORT),) if lead is not None else ()
    return replace(drive().empty(), tracks=tracks, leads=leads)


def test_the_same_vehicle_is_the_same_lead_whatever_its_number() -> None:
    found = agreement(said(car(1, 20.0), car(2, 40.0), lead=1), said(car(9, 20.4), car(8, 40.0), lead=9))
    assert (found.frames, found.lead_share, found.lead_disagreements) == (2, 1.0, ())
    assert (found.vehicles, found.only_first, found.only_second, found.class_share) == (4, 0, 0, 1.0)
    assert found.iou == pytest.approx((1.0 + 3.6 / 4.4) / 2)
    other = agreement(said(car(1, 20.0), car(2, 40.0), lead=1), said(car(9, 20.4), car(8, 40.0), lead=8))
    assert (other.lead_share, other.lead_disagreements) == (0.0, (0, 1))


def test_none_and_unclear_are_not_the_same() -> None:
    assert agreement(said(lead="none"), said(lead="none")).lead_share == 1.0
    assert agreement(said(lead="none"), said(lead="unknown")).lead_share == 0.0
    nothing = agreement(said(), said(lead="none"))
    assert (nothing.frames, nothing.lead_share, nothing.iou, nothing.class_share) == (0, None, None, None)


def test_what_only_one_has_another_class_and_a_reversed_one_are_counted() -> None:
    first = said(car(1, 20.0), car(2, 40.0), car(3, 60.0, state="proposed"))
    second = said(car(1, 20.0, "van", yaw_rad=3.1415), car(5, 80.0))
    found = agreement(first, second)
    assert (found.vehicles, found.only_first, found.only_second) == (2, 2, 2), "nobody stands behind a proposal"
    assert (found.class_share, found.reversed_share, found.iou) == (0.0, 1.0, pytest.approx(1.0, abs=1e-3))


def test_two_overlaps_too_small_to_count_do_not_prevent_one_that_counts() -> None:
    """The cars at 20 m and 23 m overlap by 1/7; each overlaps another one by less than a tenth."""
    found = agreement(said(car(1, 20.0), car(2, 26.35)), said(car(3, 23.0), car(4, 16.65)))
    assert (found.vehicles, found.only_first, found.only_second) == (2, 2, 2), "of two frames"
    assert found.iou == pytest.approx(1 / 7)


def test_labels_of_another_recording_are_refused() -> None:
    with pytest.raises(BadInput, match="different recordings"):
        agreement(said(), replace(said(), t_ns=(1, 2, 3, 4, 5, 6)))
