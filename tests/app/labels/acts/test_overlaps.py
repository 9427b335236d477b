"""Two people change the same frames: neither's change is overwritten without the other being told."""

from __future__ import annotations

from typing import Any

import pytest

from app.labels.errors import Stale
from app.labels.store.drive_labels import DriveLabels
from tests.app.labels.acts.doing import act, leads

LINE = [[0.0, 1.0], [20.0, 1.0]]
HERE: list[tuple[dict[str, Any], dict[str, Any]]] = [
    ({"kind": "set_lead", "first": 40, "last": 50, "lead": 2}, {"kind": "set_lead", "lead": "none"}),
    ({"kind": "set_lead", "first": 40, "last": 50, "lead": 2}, {"kind": "clear_lead"}),
    ({"kind": "clear_lead", "first": 12, "last": 50}, {"kind": "set_lead", "lead": "none"}),
    ({"kind": "tag", "first": 40, "last": 50, "tag": "rain"}, {"kind": "tag", "tag": "rain", "on": False}),
]


@pytest.mark.parametrize(("theirs", "mine"), HERE)
def test_overlapping_ranges_conflict_and_others_do_not(
    labels: DriveLabels, theirs: dict[str, Any], mine: dict[str, Any]
) -> None:
    act(labels, "Ada", kind="set_lead", first=8, last=45, lead=1)
    act(labels, "Ada", kind="tag", first=60, last=80, tag="rain")
    seen = labels.revision
    act(labels, "Bob", **theirs)
    with pytest.raises(Stale, match="Bob changed the"):
        act(labels, "Ada", **mine, first=44, last=60, seen=seen)
    act(labels, "Ada", **mine, first=44, last=60, seen=labels.revision)
    if mine["kind"] != "clear_lead":
        act(labels, "Ada", **mine, first=70, last=75, seen=seen)


def test_what_was_cut_elsewhere_of_the_same_range_is_no_conflict(labels: DriveLabels) -> None:
    act(labels, "Ada", kind="set_lead", first=0, last=60, lead=1)
    seen = labels.revision
    act(labels, "Bob", kind="set_lead", first=30, last=40, lead=2)
    act(labels, "Ada", kind="set_lead", first=10, last=20, lead="none", seen=seen)
    assert [each[:3] for each in leads(labels)] == [(0, 9, 1), (10, 20, "none"), (21, 29, 1), (30, 40, 2), (41, 60, 1)]


def test_a_conflict_says_what_stands_there_and_in_which_revision(labels: DriveLabels) -> None:
    seen = labels.revision
    act(labels, "Bob", kind="set_lead", first=30, last=40, lead=2)
    with pytest.raises(Stale) as refused:
        act(labels, "Ada", kind="set_lead", first=35, last=60, lead="none", seen=seen)
    stale = refused.value
    assert (stale.kind, stale.revision, stale.theirs and stale.theirs["lead"]) == ("lead", labels.revision, 2)
    act(labels, "Ada", kind="set_lead", first=35, last=60, lead="none", seen=stale.revision)
    act(labels, "Bob", kind="clear_lead", first=0, last=99)
    with pytest.raises(Stale) as refused:
        act(labels, "Ada", kind="set_lead", first=35, last=60, lead=1, seen=labels.revision - 1)
    assert refused.value.theirs is None


def test_ones_own_acts_are_no_conflict_from_whatever_page(labels: DriveLabels) -> None:
    seen = labels.revision
    act(labels, "Ada", kind="set_lead", first=30, last=40, lead=2)
    act(labels, "Ada", kind="set_lead", first=35, last=60, lead="none", seen=seen)


def test_one_path_of_a_frame_and_one_event_of_a_kind(labels: DriveLabels) -> None:
    seen = labels.revision
    act(labels, "Bob", kind="set_path", frame=5, left=LINE, right=None)
    act(labels, "Bob", kind="add_event", frame=6, event="cut_in", tracks=[1])
    with pytest.raises(Stale, match="Bob changed the path of frame 6"):
        act(labels, "Ada", kind="set_path", frame=5, left=None, right=LINE, seen=seen)
    with pytest.raises(Stale, match="path"):
        act(labels, "Ada", kind="remove_path", frame=5, seen=seen)
    with pytest.raises(Stale, match="event"):
        act(labels, "Ada", kind="add_event", frame=6, event="cut_in", tracks=[2], seen=seen)
    act(labels, "Ada", kind="add_event", frame=6, event="cut_out", tracks=[2], seen=seen)


def test_what_was_reviewed_is_cut_only_with_a_word(labels: DriveLabels) -> None:
    act(labels, "Ada", kind="set_lead", first=30, last=40, lead=2)
    (number,) = (n for n, item in labels.items("lead").items() if getattr(item.value, "first", None) == 30)
    act(labels, "Bob", kind="review_ok", items=[("lead", number)])
    for over in ({"kind": "set_lead", "lead": 1}, {"kind": "clear_lead"}):
        with pytest.raises(Stale, match="Bob has reviewed lead #2 in frames 31–41"):
            act(labels, "Ada", **over, first=38, last=50, seen=labels.revision)
    act(labels, "Ada", kind="set_lead", lead=1, first=38, last=50, seen=labels.revision, over_reviewed=True)
    assert [each[:3] for each in leads(labels)] == [(10, 20, 1), (30, 37, 2), (38, 50, 1)]


def test_a_trimmed_end_conflicts_with_what_it_runs_over(labels: DriveLabels) -> None:
    ((number, item),) = labels.items("lead").items()
    seen = labels.revision
    act(labels, "Bob", kind="set_lead", first=25, last=30, lead=2)
    trim = {"kind": "trim_lead", "range": number, "revision": item.revision, "first": 10, "seen": seen}
    with pytest.raises(Stale, match="Bob changed the lead of frames 26–29"):
        act(labels, "Ada", **trim, last=28)
    act(labels, "Ada", **trim, last=24)
