"""What each act does to labels, and when it is refused."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from app.labels.acts import do
from app.labels.acts.scope import Scope
from app.labels.database import Database
from app.labels.drive import DriveLabels
from app.labels.log import Acted
from app.labels.refusals import ActRefused, BadAct, NoSuchLabel, Stale
from app.labels.requests import Act
from app.labels.values import value_from_json
from pipeline.geometry import Cuboid
from pipeline.labels.model import LabelTrack, LeadRange, Origin, Sighting
from tests.app.labels.conftest import COUNT, fresh

ACT: TypeAdapter[Any] = TypeAdapter(Act)
PIPELINE = Origin("pipeline", "run 1", 1, "params", "camera")
BOX = {"center": [20.0, 0.0, 0.7], "size": [4.0, 1.8, 1.5], "yaw_rad": 0.0}


@pytest.fixture
def labels(sqlite_database: Database) -> DriveLabels:
    """Track 1 is proposed in frames 10 to 20, and leads there; track 2 in 15 to 30."""
    labels = DriveLabels(sqlite_database, fresh(), station="here")

    def proposals(draft: Any) -> str:
        for number, frames in ((1, range(10, 21)), (2, range(15, 31))):
            draft.add("track", LabelTrack(number, "car", (), "proposed", PIPELINE))
            cuboid = Cuboid((20.0, 0.0, 0.7), (4.0, 1.8, 1.5), 0.0)
            draft.put_sightings(number, {f: Sighting(f, cuboid, (1.0, 2.0, 3.0, 4.0), False) for f in frames})
        draft.add("lead", LeadRange(10, 20, 1, "proposed", PIPELINE))
        return "proposed"

    labels.log.act("propose", "Ada", proposals)
    return labels


def act(labels: DriveLabels, person: str = "Ada", **body: Any) -> Acted:
    """``track`` alone is given its revision as it stands, and so are items."""
    if "track" in body:
        body.setdefault("revision", labels.track(body["track"]).revision)
    if "items" in body:
        body["items"] = [
            {"kind": kind, "id": number, "revision": labels.items(kind)[number].revision}
            for kind, number in body["items"]
        ]
    doing = ACT.validate_python(body)
    return labels.log.act(doing.kind, person, lambda draft: do(draft, Scope(labels.info.t_ns), doing))


def track(labels: DriveLabels, number: int = 1) -> LabelTrack:
    found = labels.track(number).value
    assert isinstance(found, LabelTrack)
    return found


def leads(labels: DriveLabels) -> list[tuple[int, int, int | str, str]]:
    ranges = [item.value for item in labels.items("lead").values()]
    return sorted((each.first, each.last, each.lead, each.state) for each in ranges)  # type: ignore[union-attr]


# ------------------------------------------------------------ saying what is so


@pytest.mark.parametrize(("kind", "state"), [("accept", "accepted"), ("reject", "rejected")])
def test_what_a_person_says_of_a_proposal_leaves_who_made_it(labels: DriveLabels, kind: str, state: str) -> None:
    act(labels, kind=kind, items=[("track", 1), ("lead", 1)])
    assert (track(labels).state, track(labels).origin) == (state, PIPELINE)
    assert leads(labels) == [(10, 20, 1, state)]


def test_a_correction_that_is_accepted_stays_one_until_a_second_person_reviews_it(labels: DriveLabels) -> None:
    act(labels, kind="relabel", track=1, label="Truck")
    assert (track(labels).label, track(labels).state, track(labels).origin.name) == ("truck", "corrected", "Ada")
    assert act(labels, kind="accept", items=[("track", 1)]).act is None
    with pytest.raises(ActRefused, match="you changed #1 last: a second person reviews it"):
        act(labels, kind="review_ok", items=[("track", 1)])
    act(labels, "Bob", kind="review_ok", items=[("track", 1)])
    assert (track(labels).state, track(labels).origin.name, track(labels).reviewer) == ("accepted", "Ada", "Bob")
    with pytest.raises(ActRefused, match="you have reviewed #1 already"):
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
    with pytest.raises(ActRefused, match="a second person reviews it"):
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
    [("lead", "lead #1 of frames 11–21"), ("path", "the path of frame 13"), ("event", "cut-in in frame 12")],
)
def test_the_lead_paths_and_events_are_sent_back_and_reviewed(labels: DriveLabels, kind: str, what: str) -> None:
    act(labels, kind="set_path", frame=12, left=[[0, 1], [5, 1]], right=None)
    act(labels, kind="add_event", frame=11, event="cut_in", tracks=[1])
    act(labels, kind="accept", items=[("lead", 1)])
    with pytest.raises(ActRefused, match=f"you changed {what} last"):
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


# ------------------------------------------------------------ where it is


def test_a_keyframe_moves_what_lies_beyond_it(labels: DriveLabels) -> None:
    moved = BOX | {"center": [22.0, 1.0, 0.7]}
    assert act(labels, kind="set_sighting", track=1, frame=12, cuboid=moved, bbox=[1, 2, 3, 4]).what == (
        "moved #1 in frame 13"
    )
    found = track(labels)
    assert {each.cuboid.center for each in found.sightings if each.cuboid} == {(22.0, 1.0, 0.7)}
    assert [each.frame for each in found.sightings if each.keyframe] == [12]
    assert found.state == "corrected"
    assert {each.bbox for each in found.sightings} == {(1.0, 2.0, 3.0, 4.0)}


def test_a_keyframe_that_stands_alone_moves_nothing_else(labels: DriveLabels) -> None:
    act(labels, kind="set_sighting", track=1, frame=12, cuboid=BOX | {"center": [25, 0, 0.7]}, interpolate=False)
    assert [each.frame for each in track(labels).sightings if each.cuboid and each.cuboid.center[0] == 25.0] == [12]


def test_between_keyframes_the_track_follows_and_a_dropped_one_follows_too(labels: DriveLabels) -> None:
    for frame, x in ((10, 20.0), (15, 99.0), (20, 30.0)):
        act(labels, kind="set_sighting", track=1, frame=frame, cuboid=BOX | {"center": [x, 0.0, 0.7]})
    act(labels, kind="drop_keyframe", track=1, frame=15)
    places = {each.frame: each.cuboid.center[0] for each in track(labels).sightings if each.cuboid}
    assert places == {frame: pytest.approx(20.0 + (frame - 10)) for frame in range(10, 21)}
    with pytest.raises(ActRefused, match="no keyframe in frame 16"):
        act(labels, kind="drop_keyframe", track=1, frame=15)


def test_a_vehicle_can_be_taken_out_of_frames(labels: DriveLabels) -> None:
    act(labels, kind="drop_sightings", track=1, first=0, last=15)
    assert labels.changes().extents[1][:3] == (16, 20, 5)
    with pytest.raises(ActRefused, match="not in frames 1–16"):
        act(labels, kind="drop_sightings", track=1, first=0, last=15)


def test_one_size_for_every_frame_holds_the_near_side(labels: DriveLabels) -> None:
    act(labels, kind="size_along", track=1, size=[6.0, 2.0, 2.0])
    for each in track(labels).sightings:
        assert each.cuboid is not None
        assert each.cuboid.size == (6.0, 2.0, 2.0)
        assert each.cuboid.center[0] - 3.0 == pytest.approx(18.0)
        assert each.cuboid.center[2] - 1.0 == pytest.approx(0.7 - 0.75)


# ------------------------------------------------------------ which there are


def test_a_new_track_is_a_persons_and_has_a_new_number(labels: DriveLabels) -> None:
    act(labels, kind="add_track", label="van", frame=40, bbox=[1, 2, 30, 40])
    found = track(labels, 3)
    assert (found.label, found.state, found.origin.maker) == ("car", "corrected", "person")
    assert found.sightings == (Sighting(40, None, (1.0, 2.0, 30.0, 40.0), True),)


def test_a_split_track_is_two_and_the_lead_follows(labels: DriveLabels) -> None:
    act(labels, kind="split", track=1, frame=14)
    assert [each.frame for each in track(labels, 1).sightings] == [10, 11, 12, 13]
    assert [each.frame for each in track(labels, 3).sightings] == list(range(14, 21))
    assert [each[:3] for each in leads(labels)] == [(10, 13, 1), (14, 20, 3)]
    with pytest.raises(ActRefused, match="on one side of it only"):
        act(labels, kind="split", track=1, frame=14)


def test_merged_tracks_are_the_first_and_the_lead_follows(labels: DriveLabels) -> None:
    refs = [{"id": number, "revision": labels.track(number).revision} for number in (2, 1)]
    act(labels, kind="merge", tracks=refs)
    assert [each.frame for each in track(labels, 2).sightings] == list(range(10, 31))
    assert set(labels.items("track")) == {2}
    assert [each[:3] for each in leads(labels)] == [(10, 20, 2)]
    with pytest.raises(ActRefused, match="with itself"):
        act(labels, kind="merge", tracks=[{"id": 2, "revision": labels.track(2).revision}] * 2)


# ------------------------------------------------------------ who leads


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
    assert labels.log.history("lead", number)[0].what == "lead #2 in frames 52–71, not frames 61–71"


def test_the_lead_can_be_unsaid(labels: DriveLabels) -> None:
    act(labels, kind="clear_lead", first=0, last=15)
    assert [each[:3] for each in leads(labels)] == [(16, 20, 1)]
    with pytest.raises(ActRefused, match="nobody has said who leads in frames 1–16"):
        act(labels, kind="clear_lead", first=0, last=15)


# ------------------------------------------------------------ frames


def test_a_path_of_a_frame_is_drawn_drawn_again_and_removed(labels: DriveLabels) -> None:
    act(labels, kind="set_path", frame=3, left=[[0, 1.5], [20, 1.5]], right=None)
    act(labels, kind="set_path", frame=3, left=None, right=[[0, -1.5], [20, -1.5]])
    (path,) = labels.label_set().paths
    assert (path.left, path.right) == (None, ((0.0, -1.5), (20.0, -1.5)))
    act(labels, kind="remove_path", frame=3)
    assert labels.label_set().paths == ()
    with pytest.raises(NoSuchLabel):
        act(labels, kind="remove_path", frame=3)


def tags(labels: DriveLabels) -> list[tuple[int, int, str, str]]:
    return [(each.first, each.last, each.tag, each.origin.name) for each in labels.label_set().tags]


def test_a_tag_is_there_once_or_not(labels: DriveLabels) -> None:
    act(labels, kind="tag", first=3, last=3, tag="night")
    assert act(labels, kind="tag", first=3, last=3, tag="night").act is None
    assert tags(labels) == [(3, 3, "night", "Ada")]
    act(labels, kind="tag", first=3, last=3, tag="night", on=False)
    assert tags(labels) == []


def test_frames_are_tagged_and_untagged_with_one_act(labels: DriveLabels) -> None:
    """What another person said stays theirs; what one says beside their own is one range with it."""
    act(labels, "Bob", kind="tag", first=4, last=5, tag="night")
    done = act(labels, kind="tag", first=2, last=9, tag="night")
    assert done.what == "tagged frames 3–10 night"
    assert tags(labels) == [(2, 3, "night", "Ada"), (4, 5, "night", "Bob"), (6, 9, "night", "Ada")]
    act(labels, kind="tag", first=10, last=12, tag="night")
    act(labels, kind="tag", first=0, last=20, tag="rain")
    assert tags(labels)[-1] == (6, 12, "night", "Ada")
    assert act(labels, kind="tag", first=3, last=8, tag="night", on=False).what == "frames 4–9 are not night"
    left = [(0, 20, "rain", "Ada"), (2, 2, "night", "Ada"), (9, 12, "night", "Ada")]
    assert tags(labels) == left
    labels.log.move("undo", "Ada")
    assert [each[:2] for each in tags(labels) if each[2] == "night"] == [(2, 3), (4, 5), (6, 12)]
    labels.log.move("redo", "Ada")
    assert tags(labels) == left
    act(labels, kind="tag", first=5, last=6, tag="rain", on=False)
    assert [each[:2] for each in tags(labels) if each[2] == "rain"] == [(0, 4), (7, 20)]


@pytest.mark.parametrize(
    "body",
    [
        {"kind": "tag", "first": 5, "last": 4, "tag": "night"},
        {"kind": "tag", "first": 5, "last": COUNT, "tag": "night"},
        {"kind": "set_sighting", "track": 1, "frame": COUNT, "cuboid": BOX},
        {"kind": "set_sighting", "track": 1, "frame": 3},
        {"kind": "set_sighting", "track": 1, "frame": 3, "bbox": [3, 3, 3, 9]},
        {"kind": "add_track", "label": "car", "frame": COUNT, "cuboid": BOX},
        {"kind": "set_lead", "first": 5, "last": 4, "lead": "none"},
        {"kind": "set_lead", "first": 5, "last": COUNT, "lead": "none"},
        {"kind": "set_path", "frame": 3, "left": None, "right": None},
        {"kind": "accept", "items": [("tag", 1)]},
        {"kind": "send_back", "items": [("tag", 1)], "comment": "it is another"},
    ],
)
def test_what_makes_no_sense_is_refused(labels: DriveLabels, body: dict[str, Any]) -> None:
    act(labels, kind="tag", first=1, last=1, tag="night")
    before = labels.revision
    with pytest.raises(BadAct):
        act(labels, **body)
    assert labels.revision == before


@pytest.mark.parametrize(
    "body",
    [
        {"kind": "set_lead", "first": 1, "last": 2, "lead": 77},
        {"kind": "relabel", "track": 77, "revision": 1, "label": "car"},
    ],
)
def test_what_is_not_there_is_said(labels: DriveLabels, body: dict[str, Any]) -> None:
    doing = ACT.validate_python(body)
    with pytest.raises(NoSuchLabel, match="there is no track 77"):
        labels.log.act(doing.kind, "Ada", lambda draft: do(draft, Scope(labels.info.t_ns), doing))


@pytest.mark.parametrize(
    "body",
    [
        {"kind": "explode"},
        {"kind": "relabel", "track": 1, "revision": 1, "label": " \n "},
        {"kind": "relabel", "track": 2**63, "revision": 1, "label": "car"},
        {"kind": "set_sighting", "track": 1, "revision": 1, "frame": 1, "cuboid": BOX | {"size": [0, 1, 1]}},
        {"kind": "set_sighting", "track": 1, "revision": 1, "frame": 1, "cuboid": BOX | {"yaw_rad": float("nan")}},
        {"kind": "accept", "items": []},
        {"kind": "send_back", "items": [{"kind": "track", "id": 1, "revision": 1}], "comment": " \n "},
        {"kind": "tag", "first": 1, "last": 1, "tag": "x", "extra": 1},
    ],
)
def test_a_form_that_is_none_is_not_taken(body: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        ACT.validate_python(body)


def test_labels_that_were_kept_before_there_were_reviews_are_read() -> None:
    origin = {"maker": "person", "name": "Ada", "t_unix_ms": 5, "params": None, "calibration": None}
    kept = {"first": 1, "last": 2, "lead": 3, "state": "accepted", "origin": origin}
    assert value_from_json("lead", kept) == LeadRange(1, 2, 3, "accepted", Origin("person", "Ada", 5), "", "")
