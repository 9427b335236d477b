"""Accepting, rejecting and reviewing labels."""

from __future__ import annotations

from typing import Any, cast

import pytest

from app.labels.errors import ActRefused
from app.labels.store.drive_labels import DriveLabels
from app.labels.store.values import KINDS, value_from_json
from pipeline.labels.model import NEXT_TAG, FrameTag, LeadRange, Origin
from tests.app.labels.acts.conftest import PIPELINE
from tests.app.labels.acts.doing import act, leads, track


@pytest.mark.parametrize(("kind", "state"), [("accept", "accepted"), ("reject", "rejected")])
def test_what_a_person_says_of_a_proposal_leaves_who_made_it(labels: DriveLabels, kind: str, state: str) -> None:
    act(labels, kind=kind, items=[("track", 1), ("lead", 1)])
    assert (track(labels).state, track(labels).origin) == (state, PIPELINE)
    assert leads(labels) == [(10, 20, 1, state)]


def test_a_correction_that_is_accepted_stays_one_until_a_second_person_reviews_it(labels: DriveLabels) -> None:
    act(labels, kind="relabel", track=1, label="Truck")
    assert (track(labels).label, track(labels).state, track(labels).origin.name) == ("truck", "corrected", "Ada")
    assert act(labels, kind="accept", items=[("track", 1)]).act is None
    with pytest.raises(ActRefused, match="#1 is your own: a second person must review it"):
        act(labels, kind="review_ok", items=[("track", 1)])
    act(labels, "Bob", kind="review_ok", items=[("track", 1)])
    assert (track(labels).state, track(labels).origin.name, track(labels).reviewer) == ("accepted", "Ada", "Bob")
    with pytest.raises(ActRefused, match="you have already reviewed #1"):
        act(labels, "Bob", kind="review_ok", items=[("track", 1)])
    act(labels, "Cy", kind="relabel", track=1, label="Bus")
    assert track(labels).reviewer == "", "what is changed is to be reviewed again"


@pytest.mark.parametrize(
    ("before", "refused"),
    [
        pytest.param([("Ada", "relabel", "bus"), ("Bob", "relabel", "van"), ("Bob", "undo", "")], "Ada", id="undone"),
        pytest.param([("Ada", "relabel", "bus"), ("Ada", "undo", ""), ("Ada", "redo", "")], "Ada", id="done again"),
        pytest.param([("Ada", "relabel", "bus"), ("Bob", "send_back", "no")], "Ada", id="sent back to its maker"),
        pytest.param([("Ada", "relabel", "bus"), ("Bob", "relabel", "van")], "Bob", id="changed by the second"),
    ],
)
def test_ones_own_work_is_reviewed_by_another(
    labels: DriveLabels, before: list[tuple[str, Any, str]], refused: str
) -> None:
    for person, kind, more in before:
        if kind == "relabel":
            act(labels, person, kind=kind, track=1, label=more)
        elif kind == "send_back":
            act(labels, person, kind=kind, items=[("track", 1)], comment=more)
        else:
            labels.log.move(kind, person)
    with pytest.raises(ActRefused, match="a second person must review it"):
        act(labels, refused, kind="review_ok", items=[("track", 1)])
    act(labels, "Cy", kind="review_ok", items=[("track", 1)])
    assert track(labels).state == "accepted"


def test_what_is_sent_back_is_proposed_again_with_the_comment(labels: DriveLabels) -> None:
    act(labels, kind="accept", items=[("track", 1)])
    act(labels, "Bob", kind="send_back", items=[("track", 1)], comment="its rear\n is too low")
    assert (track(labels).state, track(labels).comment) == ("proposed", "its rear is too low")
    act(labels, kind="accept", items=[("track", 1)])
    assert (track(labels).state, track(labels).comment) == ("accepted", "")


def said_of(labels: DriveLabels, kind: Any) -> tuple[str, str, str]:
    value: Any = labels.items(kind)[1].value
    return value.state, value.comment, value.reviewer


@pytest.mark.parametrize(
    ("kind", "what"),
    [("lead", "lead #1 in frames 11–21"), ("path", "the path of frame 13"), ("event", "cut-in in frame 12")],
)
def test_the_lead_paths_and_events_are_sent_back_and_reviewed(labels: DriveLabels, kind: str, what: str) -> None:
    act(labels, kind="set_path", frame=12, left=[[0, 1], [5, 1]], right=None)
    act(labels, kind="add_event", frame=11, event="cut_in", tracks=[1])
    act(labels, kind="accept", items=[("lead", 1)])
    with pytest.raises(ActRefused, match=f"{what} is your own"):
        act(labels, kind="review_ok", items=[(kind, 1)])
    assert act(labels, "Bob", kind="send_back", items=[(kind, 1)], comment="no").what == f"sent back {what}: no"
    assert said_of(labels, kind) == ("proposed", "no", "")
    act(labels, kind="accept", items=[(kind, 1)])
    assert act(labels, "Bob", kind="review_ok", items=[(kind, 1)]).what == f"reviewed and accepted {what}"
    assert said_of(labels, kind) == ("accepted", "", "Bob")
    labels.log.move("undo", "Bob")
    assert said_of(labels, kind) == ("accepted", "", "")


def test_what_was_reviewed_is_not_lengthened_by_what_was_not(labels: DriveLabels) -> None:
    act(labels, kind="set_lead", first=30, last=40, lead=2)
    number = max(labels.items("lead"))
    act(labels, "Bob", kind="review_ok", items=[("lead", number)])
    act(labels, kind="set_lead", first=41, last=45, lead=2)
    ranges = [labels.items("lead")[each].value for each in (number, number + 1)]
    assert [(each.first, each.last, each.reviewer) for each in ranges] == [(30, 40, "Bob"), (41, 45, "")]  # type: ignore[union-attr]
    act(labels, kind="set_lead", first=35, last=36, lead="none")
    assert [(first, last) for first, last, who, _ in leads(labels) if who == 2] == [(30, 34), (37, 40), (41, 45)]


def test_what_names_a_removed_track_goes_with_it(labels: DriveLabels) -> None:
    act(labels, kind="add_event", frame=15, event="cut_in", tracks=[1, 2])
    act(labels, kind="remove", items=[("track", 1)])
    assert leads(labels) == []
    assert [item.value.tracks for item in labels.items("event").values()] == [(2,)]  # type: ignore[union-attr]
    labels.log.move("undo", "Ada")
    assert leads(labels) == [(10, 20, 1, "proposed")]
    assert len(track(labels).sightings) == 11


def test_labels_that_were_kept_before_there_were_reviews_are_read() -> None:
    origin = {"maker": "person", "name": "Ada", "t_unix_ms": 5, "params": None, "calibration": None}
    kept = {"first": 1, "last": 2, "lead": 3, "state": "accepted", "origin": origin}
    assert value_from_json("lead", kept) == LeadRange(1, 2, 3, "accepted", Origin("person", "Ada", 5), "", "")


def test_everything_is_removed_for_a_second_labeler_but_queued_frames(labels: DriveLabels) -> None:
    act(labels, kind="tag", first=0, last=3, tag="night")
    act(labels, kind="tag", first=5, last=7, tag=NEXT_TAG)
    act(labels, kind="add_event", frame=4, event="cut_in")
    assert labels.items("track")
    before = labels.unnamed_set()
    act(labels, kind="clear_all", revision=labels.revision)
    assert [kind for kind in KINDS if labels.items(kind)] == ["tag"]
    assert [cast("FrameTag", each.value).tag for each in labels.items("tag").values()] == [NEXT_TAG]
    labels.log.move("undo", "Ada", lambda params: params)
    assert labels.unnamed_set() == before, "one undo brings it back"


def test_labels_that_changed_after_they_were_frozen_are_not_removed(labels: DriveLabels) -> None:
    seen = labels.revision
    act(labels, "Bob", kind="tag", first=0, last=3, tag="night")
    with pytest.raises(ActRefused, match="somebody has changed labels since"):
        act(labels, kind="clear_all", revision=seen)
    assert labels.items("track")


CUTS: list[tuple[str, dict[str, Any]]] = [
    ("its middle", {"kind": "set_lead", "first": 34, "last": 35, "lead": "none"}),
    ("its end", {"kind": "set_lead", "first": 38, "last": 45, "lead": 2}),
    ("cleared", {"kind": "clear_lead", "first": 34, "last": 35}),
    ("its track split", {"kind": "split", "track": 1, "frame": 15}),
]


@pytest.mark.parametrize("cut", [pytest.param(cut, id=name) for name, cut in CUTS])
def test_what_is_left_of_a_lead_range_is_reviewed_by_who_cut_it(labels: DriveLabels, cut: dict[str, Any]) -> None:
    act(labels, kind="set_lead", first=10, last=20, lead=1)
    act(labels, kind="set_lead", first=30, last=40, lead=2)
    act(labels, "Bob", **cut)
    ranges = {number: cast("LeadRange", item.value) for number, item in labels.items("lead").items()}
    assert "Ada" in {each.origin.name for each in ranges.values()}
    for number, each in ranges.items():
        author = each.origin.name
        with pytest.raises(ActRefused, match="a second person must review it"):
            act(labels, author, kind="review_ok", items=[("lead", number)])
        act(labels, "Bob" if author == "Ada" else "Ada", kind="review_ok", items=[("lead", number)])


def test_who_accepted_a_proposed_lead_does_not_review_what_another_left_of_it(labels: DriveLabels) -> None:
    act(labels, kind="accept", items=[("lead", 1)])
    act(labels, "Bob", kind="set_lead", first=14, last=15, lead="none")
    act(labels, "Bob", kind="clear_lead", first=18, last=18)
    parts = {number for number, each in labels.items("lead").items() if each.value.lead == 1}  # type: ignore[union-attr]
    assert len(parts) == 3
    assert {labels.authors()["lead", number] for number in parts} == {"Ada"}
    for number in parts:
        with pytest.raises(ActRefused, match=r"lead #1 in .* is your own"):
            act(labels, kind="review_ok", items=[("lead", number)])
        act(labels, "Bob", kind="review_ok", items=[("lead", number)])
    labels.log.move("undo", "Bob")
    assert {labels.authors()["lead", number] for number in parts} == {"Ada"}


def test_whoever_moves_the_end_of_a_range_is_its_author(labels: DriveLabels) -> None:
    act(labels, kind="set_lead", first=30, last=40, lead=2)
    number = max(labels.items("lead"))
    revision = labels.items("lead")[number].revision
    act(labels, "Bob", kind="trim_lead", range=number, revision=revision, first=30, last=45)
    assert labels.authors()["lead", number] == "Bob"


def test_a_proposal_has_no_author_until_it_is_accepted(labels: DriveLabels) -> None:
    assert labels.authors() == {}
    act(labels, "Bob", kind="accept", items=[("track", 1), ("lead", 1)])
    assert labels.authors() == {("track", 1): "Bob", ("lead", 1): "Bob"}
    labels.log.move("undo", "Bob")
    assert labels.authors() == {}
