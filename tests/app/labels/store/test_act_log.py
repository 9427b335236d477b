"""Acts: each is one row, two at once are told apart, and all labels come back as they were put."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

import pytest

from app.labels.acts.requests import AddTrack, Relabel, SetLead, SetSighting
from app.labels.errors import ActRefused, Stale
from app.labels.store.database import Database
from app.labels.store.draft import Draft
from app.labels.store.drive_labels import DriveLabels
from pipeline.labels.model import LeadRange
from tests.app.labels.conftest import info
from tests.app.labels.doing import act, add, cuboid, relabel, shown

# ------------------------------------------------------------ one act


def test_an_act_is_one_row_and_what_it_changed(labels: DriveLabels) -> None:
    number = add(labels)
    assert (labels.revision, number) == (1, 1)
    (entry,) = labels.log.history("track", number)
    assert (entry.act, entry.person, entry.what, entry.before, entry.undone) == (
        1,
        "Ada",
        "added #1, a car, in frame 11",
        None,
        False,
    )
    assert entry.after is not None
    assert [each["frame"] for each in entry.after["sightings"]] == [10]


def test_an_act_that_is_refused_leaves_no_trace(labels: DriveLabels) -> None:
    number = add(labels)
    before = shown(labels)

    def half_done(draft: Draft) -> str:
        draft.put("track", number, None)
        raise ActRefused("no")

    with pytest.raises(ActRefused):
        labels.log.act("remove", "Ada", half_done)
    assert (shown(labels), labels.revision) == (before, 1)
    assert len(labels.log.history("track", number)) == 1


def test_what_changes_nothing_is_no_act(labels: DriveLabels) -> None:
    number = add(labels)
    relabel(labels, number, "truck")
    again = labels.log.act("x", "Ada", lambda draft: draft.put("track", number, draft.get("track", number).value) or "")
    assert (again.act, again.what, labels.revision) == (None, "nothing changed", 2)


def test_a_number_is_never_given_twice(labels: DriveLabels) -> None:
    first = add(labels)
    labels.log.act("remove", "Ada", lambda draft: draft.put("track", first, None) or "removed")
    assert add(labels) == first + 1


def test_only_what_changed_since_is_told(labels: DriveLabels) -> None:
    first, second = add(labels), add(labels)
    third = act(labels, "Ada", SetLead(kind="set_lead", first=0, last=5, lead=first)).revision
    labels.log.act("remove", "Ada", lambda draft: draft.put("track", second, None) or "removed")
    changes = labels.changes(since=2)
    assert [(item.kind, item.id, item.revision) for item in changes.items] == [("lead", 1, third)]
    assert (changes.removed, changes.revision) == ([("track", second)], 4)
    assert labels.changes(0).extents == {first: (10, 10, 1, [10])}


# ------------------------------------------------------------ two at once


def test_a_stale_edit_says_whose_it_is_and_writes_nothing(labels: DriveLabels) -> None:
    number = add(labels)
    seen = labels.track(number).revision
    relabel(labels, number, "bus", "Bob")
    late = SetSighting(kind="set_sighting", track=number, revision=seen, frame=10, cuboid=cuboid(30.0))
    with pytest.raises(Stale, match="Bob changed #1 since") as stale:
        act(labels, "Ada", late)
    assert stale.value.theirs is not None
    assert (stale.value.theirs["label"], stale.value.theirs["revision"]) == ("bus", 2)
    labels.log.act("remove", "Bob", lambda draft: draft.put("track", number, None) or "removed")
    with pytest.raises(Stale, match="Bob removed #1 since") as gone:
        act(labels, "Ada", late)
    assert gone.value.theirs is None


def test_of_two_edits_of_one_label_at_once_one_wins_and_one_is_told(labels: DriveLabels) -> None:
    number = add(labels)
    seen = labels.track(number).revision
    outcomes: list[object] = []
    barrier = threading.Barrier(2)

    def edit(person: str, label: str) -> None:
        barrier.wait()
        try:
            outcomes.append(act(labels, person, Relabel(kind="relabel", track=number, revision=seen, label=label)))
        except Stale as stale:
            outcomes.append(stale)

    together(lambda: edit("Ada", "bus"), lambda: edit("Bob", "truck"))
    assert sorted(type(outcome).__name__ for outcome in outcomes) == ["Acted", "Stale"]
    assert labels.revision == 2


def test_many_acts_at_once_are_all_there(labels: DriveLabels, database: Database) -> None:
    """On two servers: each act has its own number, and none is lost."""
    other = DriveLabels(database, labels.info, station="there")
    together(
        *(lambda on=on, who=who: [add_only(on, who) for _ in range(5)] for on, who in ((labels, "A"), (other, "B")))
    )
    assert labels.revision == other.revision == 10
    assert set(labels.items("track")) == set(range(1, 11))


def add_only(labels: DriveLabels, person: str) -> None:
    act(labels, person, AddTrack(kind="add_track", label="car", frame=10, cuboid=cuboid()))


def together(*work: Callable[[], object]) -> None:
    threads = [threading.Thread(target=each) for each in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


# ------------------------------------------------------------ as a whole


def test_all_labels_come_back_as_they_were_put(labels: DriveLabels) -> None:
    number = add(labels)
    act(labels, "Ada", SetLead(kind="set_lead", first=0, last=5, lead=number))
    act(labels, "Ada", SetLead(kind="set_lead", first=2, last=3, lead="unknown"))
    found = shown(labels)
    assert [(each.first, each.last, each.lead) for each in found.leads] == [(0, 1, 1), (2, 3, "unknown"), (4, 5, 1)]
    assert all(isinstance(each, LeadRange) and each.origin.name == "Ada" for each in found.leads)
    (track,) = found.tracks
    assert track.sightings[0].cuboid is not None
    assert track.sightings[0].cuboid.center == (20.0, 0.0, 0.7)


def test_a_frozen_version_stays_as_it_was(labels: DriveLabels, monkeypatch: pytest.MonkeyPatch) -> None:
    number = add(labels)
    before = shown(labels)
    version = labels.freeze("first", "Ada")
    assert (version.tracks, version.frames) == (1, 1)
    relabel(labels, number, "bus")
    assert replace(labels.label_set("first"), name="working") == before
    assert [each.name for each in labels.versions()] == ["first"]
    for taken in ("first", "working"):
        with pytest.raises(ActRefused, match="never overwritten"):
            labels.freeze(taken, "Bob")
    monkeypatch.setattr(DriveLabels, "versions", lambda _: [])  # as for who looked before the other wrote
    with pytest.raises(ActRefused, match="never overwritten"):
        labels.freeze("first", "Bob")


def test_labels_of_one_drive_are_not_anothers(labels: DriveLabels, database: Database) -> None:
    add(labels)
    other = DriveLabels(database, info(labels.info.key + " of another"))
    assert not other.has_labels()
    assert DriveLabels(database, replace(labels.info, uri="moved:elsewhere")).has_labels()


def test_a_flood_of_acts_of_many_people_is_done_one_after_the_other(labels: DriveLabels) -> None:
    """Thirty people with three acts each at once: more than the number of database connections."""
    wrong: list[BaseException] = []

    def work(person: str) -> None:
        try:
            for number in range(3):
                act(labels, person, AddTrack(kind="add_track", label="car", frame=number, cuboid=cuboid()))
        except BaseException as error:
            wrong.append(error)

    people = [threading.Thread(target=work, args=(f"person {number}",)) for number in range(30)]
    for each in people:
        each.start()
    for each in people:
        each.join()
    assert wrong == []
    assert labels.revision == 90
    assert sorted(labels.items("track")) == list(range(1, 91))
