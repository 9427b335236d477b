"""Lead ranges: which vehicle leads, from when to when."""

from __future__ import annotations

from typing import Any

import pytest

from app.labels.errors import ActRefused, Stale
from app.labels.store.drive_labels import DriveLabels
from tests.app.labels.acts.doing import act, leads


@pytest.mark.parametrize(
    ("painted", "left"),
    [
        ((12, 15, 2), [(10, 11, 1), (12, 15, 2), (16, 20, 1)]),
        ((5, 12, "none"), [(5, 12, "none"), (13, 20, 1)]),
        ((18, 25, "unknown"), [(10, 17, 1), (18, 25, "unknown")]),
        ((10, 20, 2), [(10, 20, 2)]),
        ((0, 99, "none"), [(0, 99, "none")]),
        ((30, 30, 1), [(10, 20, 1), (30, 30, 1)]),
    ],
)
def test_painting_the_lead_cuts_what_was_there(
    labels: DriveLabels, painted: tuple[int, int, Any], left: list[tuple[int, int, Any]]
) -> None:
    first, last, lead = painted
    act(labels, kind="set_lead", first=first, last=last, lead=lead)
    assert [each[:3] for each in leads(labels)] == left


def test_strokes_side_by_side_are_one_range(labels: DriveLabels) -> None:
    for first in (40, 42, 44):
        act(labels, kind="set_lead", first=first, last=first + 1, lead=2)
    act(labels, "Bob", kind="set_lead", first=46, last=47, lead=2)
    assert [each[:3] for each in leads(labels)][1:] == [(40, 45, 2), (46, 47, 2)]


@pytest.mark.parametrize(
    ("ends", "left"),
    [
        ((12, 20), [(5, 9, 2, "accepted"), (12, 20, 1, "corrected"), (21, 30, "none", "accepted")]),
        ((7, 20), [(5, 6, 2, "accepted"), (7, 20, 1, "corrected"), (21, 30, "none", "accepted")]),
        ((10, 25), [(5, 9, 2, "accepted"), (10, 25, 1, "corrected"), (26, 30, "none", "accepted")]),
        ((0, 35), [(0, 35, 1, "corrected")]),
        ((10, 10), [(5, 9, 2, "accepted"), (10, 10, 1, "corrected"), (21, 30, "none", "accepted")]),
    ],
)
def test_a_range_ends_elsewhere_and_its_neighbours_give_way(
    labels: DriveLabels, ends: tuple[int, int], left: list[tuple[int, int, Any, str]]
) -> None:
    act(labels, kind="set_lead", first=5, last=9, lead=2)
    act(labels, kind="set_lead", first=21, last=30, lead="none")
    (number, before), *_ = ((number, item) for number, item in labels.items("lead").items() if item.value.lead == 1)  # type: ignore[union-attr]
    there = leads(labels)
    act(labels, kind="trim_lead", range=number, revision=before.revision, first=ends[0], last=ends[1])
    assert leads(labels) == left
    with pytest.raises(Stale):
        act(labels, "Bob", kind="trim_lead", range=number, revision=before.revision, first=10, last=11)
    labels.log.move("undo", "Ada")
    assert leads(labels) == there


def test_a_range_that_comes_to_one_that_says_the_same_is_one_with_it(labels: DriveLabels) -> None:
    act(labels, kind="set_lead", first=40, last=50, lead=2)
    act(labels, kind="set_lead", first=60, last=70, lead=2)
    number, later = max(labels.items("lead").items())
    act(labels, kind="trim_lead", range=number, revision=later.revision, first=51, last=70)
    assert leads(labels)[1:] == [(40, 70, 2, "accepted")]
    assert labels.log.history("lead", number)[0].what == "lead #2: frames 61–71 → frames 52–71"


def test_the_lead_can_be_unsaid(labels: DriveLabels) -> None:
    act(labels, kind="clear_lead", first=0, last=15)
    assert [each[:3] for each in leads(labels)] == [(16, 20, 1)]
    with pytest.raises(ActRefused, match="no lead is labelled in frames 1–16"):
        act(labels, kind="clear_lead", first=0, last=15)
