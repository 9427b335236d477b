"""Proposals and imported labels, added to labels that people have already made."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.core.jobs import Cancelled
from app.labels.acts.bulk import importing, put_proposals
from app.labels.errors import ActRefused
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from pipeline.common.geometry import Cuboid
from pipeline.labels.model import EventLabel, FrameTag, LabelSet, LabelTrack, LeadRange, Origin, Sighting, State
from pipeline.labels.propose import Proposals, Seen, propose
from tests.app.labels.conftest import fresh

PIPELINE = Origin("pipeline", "run 1", 1, "p", "c")
FILE, ADA = Origin("import", "a file", 2), Origin("person", "Ada", 3)


def car(number: int, state: State, origin: Origin, comment: str = "", x: float = 20.0) -> LabelTrack:
    """In frames 10 to 20."""
    seen = (Sighting(f, Cuboid((x, 0.0, 0.7), (4.0, 1.8, 1.5), 0.0), None, False) for f in range(10, 21))
    return LabelTrack(number, "car", tuple(seen), state, origin, comment)


def lead(number: int, origin: Origin = PIPELINE, state: State = "proposed") -> LeadRange:
    return LeadRange(10, 20, number, state, origin)


@pytest.fixture
def labels(sqlite_database: Database) -> DriveLabels:
    return DriveLabels(sqlite_database, fresh(), station="here")


def of(labels: DriveLabels, *tracks: LabelTrack, leads: tuple[LeadRange, ...] = ()) -> LabelSet:
    """As imported from a file of the same recording."""
    return LabelSet(labels.info.uri, labels.info.names(), labels.info.t_ns, tracks, leads)


def put(labels: DriveLabels, *tracks: LabelTrack, leads: tuple[LeadRange, ...] = ()) -> None:
    importing(labels, of(labels, *tracks, leads=leads), "Ada", ())


def test_what_the_camera_alone_has_seen_is_proposed_without_a_cuboid_and_that_is_said(labels: DriveLabels) -> None:
    box = (10.0, 20.0, 60.0, 50.0)
    flat = Seen(7, "car", None, box, in_path=False, carried=False)
    solid = replace(flat, id=8, cuboid=Cuboid((20.0, 3.0, 0.7), (4.0, 1.8, 1.5), 0.0))
    found = propose({frame: [flat, solid] for frame in (10, 11)}, {}, PIPELINE)
    said = put_proposals(labels, found, "Ada", 0, 20)
    assert said == "proposed 2 tracks in frames 1–21; 1 seen by the camera only, without a cuboid"
    assert sorted(each.cuboid is None for _, each in labels.window(10, 10)[1][10]) == [False, True]


@pytest.mark.parametrize(
    ("there", "replaced"),
    [
        pytest.param(car(7, "proposed", PIPELINE), True, id="nobody has looked"),
        pytest.param(car(7, "proposed", PIPELINE, "its rear is too low"), False, id="sent back"),
        pytest.param(car(7, "proposed", ADA, "its rear is too low"), False, id="a person's, sent back"),
        pytest.param(car(7, "proposed", FILE), False, id="a file's"),
        pytest.param(car(7, "corrected", ADA), False, id="corrected"),
        pytest.param(car(7, "rejected", PIPELINE), False, id="rejected"),
    ],
)
def test_only_what_nobody_has_looked_at_is_proposed_anew(
    labels: DriveLabels, there: LabelTrack, replaced: bool
) -> None:
    put(labels, there, leads=(lead(7, there.origin),))
    anew = replace(PIPELINE, name="run 2")
    put_proposals(labels, Proposals((car(1, "proposed", anew, x=20.3),), (lead(1, anew),)), "Ada", 0, 99)
    (track,) = labels.label_set().tracks
    (range_,) = labels.label_set().leads
    assert track == (car(7, "proposed", anew, x=20.3) if replaced else there)
    assert range_ == lead(7, anew if there.origin is PIPELINE else there.origin)


def test_what_is_imported_again_is_there_once(labels: DriveLabels) -> None:
    file = replace(
        of(labels, car(3, "accepted", FILE), leads=(lead(3, FILE),)),
        events=(EventLabel(12, "cut_in", (3,), "accepted", FILE),),
        tags=(FrameTag(4, 6, "night", FILE),),
    )
    put(labels, car(3, "corrected", ADA, x=50.0))
    for _ in range(2):
        importing(labels, file, "Ada", ())
    now = labels.label_set()
    assert [track.id for track in now.tracks] == [3, 4]
    assert [(each.frame, each.kind, each.tracks) for each in now.events] == [(12, "cut_in", (4,))]
    assert [(each.first, each.lead) for each in now.leads] == [(10, 4)]
    assert [(each.first, each.last, each.tag) for each in now.tags] == [(4, 6, "night")]


@pytest.mark.parametrize(
    ("ours", "kept"),
    [
        (car(1, "proposed", PIPELINE), False),
        (car(1, "proposed", PIPELINE, "look again"), True),
        (car(1, "rejected", PIPELINE), True),
        (car(1, "corrected", ADA), True),
    ],
)
def test_a_proposal_nobody_looked_at_is_what_the_file_says_of_it(
    labels: DriveLabels, ours: LabelTrack, kept: bool
) -> None:
    put(labels, ours)
    said = importing(labels, of(labels, car(9, "accepted", FILE, "sure")), "Ada", ())
    assert "1 tracks are already here" in said
    assert labels.label_set().tracks == (ours if kept else car(1, "accepted", FILE, "sure"),)


@pytest.mark.parametrize("tracks", [(car(2, "accepted", FILE),), ()], ids=["beside others", "alone"])
@pytest.mark.parametrize("what", ["lead", "event"])
def test_what_names_a_track_that_is_not_there_is_not_taken(
    labels: DriveLabels, what: str, tracks: tuple[LabelTrack, ...]
) -> None:
    """The #1 in the database is not the #1 of the file."""
    put(labels, car(1 if tracks else 5, "corrected", ADA, x=50.0))
    file = of(labels, *tracks)
    if what == "lead":
        file = replace(file, leads=(lead(1, FILE),))
    else:
        file = replace(file, events=(EventLabel(12, "cut_in", (1,), "accepted", FILE),))
    before = labels.label_set()
    with pytest.raises(ActRefused, match="#1"):
        importing(labels, file, "Ada", ())
    assert labels.label_set() == before


def test_leads_without_tracks_are_of_those_that_are_here(labels: DriveLabels) -> None:
    """As in a table of leads."""
    put(labels, car(1, "corrected", ADA))
    importing(labels, of(labels, leads=(lead(1, FILE),)), "Ada", ())
    assert [each.lead for each in labels.label_set().leads] == [1]


def test_what_is_cancelled_while_it_is_written_is_not_written(labels: DriveLabels) -> None:
    def nobody(done: int, total: int) -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        put_proposals(labels, Proposals((car(1, "proposed", PIPELINE),), ()), "Ada", 0, 99, nobody)
    with pytest.raises(Cancelled):
        importing(labels, of(labels, car(1, "accepted", FILE)), "Ada", (), nobody)
    assert labels.revision == 0


def test_a_number_that_a_removed_track_had_is_not_given_to_what_comes_from_elsewhere(labels: DriveLabels) -> None:
    """That id's history belongs to another vehicle."""
    put(labels, car(7, "accepted", FILE))
    labels.log.act("remove", "Ada", lambda draft: draft.put("track", 7, None) or "removed")
    put(labels, car(7, "accepted", FILE, x=30.0))
    put_proposals(labels, Proposals((car(7, "proposed", PIPELINE, x=60.0),), (lead(7),)), "Ada", 0, 30)
    assert sorted(labels.items("track")) == [8, 9]
    assert [entry.what for entry in labels.log.history("track", 7)] == [
        "removed",
        "imported 1 tracks and 0 ranges of the lead",
    ]
