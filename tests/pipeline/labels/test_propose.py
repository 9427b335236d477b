"""What a run saw, as proposals, and which of them are labelled already."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.common.geometry import Cuboid
from pipeline.labels.headings import Moment
from pipeline.labels.model import LabelSet, LabelTrack, Origin, Sighting
from pipeline.labels.propose import Seen, known_as, propose
from pipeline.labels.validate import check

PERSON = Cuboid((20.0, 0.0, 0.85), (0.6, 0.6, 1.7), 0.0)
BY = Origin("pipeline", "run 1", 5, "params", "camera")


def seen(number: int, x: float = 20.0, y: float = 0.0, **values: object) -> Seen:
    plain = Seen(number, "car", Cuboid((x, y, 0.7), (4.0, 1.8, 1.5), 0.0), None, False, False)
    return replace(plain, **values)  # type: ignore[arg-type]


def frames_of(track: LabelTrack) -> list[int]:
    return [each.frame for each in track.sightings]


@pytest.mark.parametrize(
    ("life", "is_proposed"),
    [
        ([seen(7), seen(7)], True),
        ([seen(7)], False),
        ([seen(7, bbox=(1.0, 2.0, 3.0, 4.0))], True),
        ([seen(7, label=None), seen(7, label=None)], False),
        ([seen(7, label=None, in_path=True), seen(7, label=None)], False),
        ([seen(7, label="traffic light"), seen(7, label="traffic light")], False),
        ([seen(7, label="person", cuboid=PERSON), seen(7, label=None, cuboid=PERSON)], True),
        ([seen(7, carried=True), seen(7, carried=True)], False),
        ([seen(7, cuboid=None), seen(7, cuboid=None)], False),
        ([seen(7, cuboid=None, bbox=(1.0, 2.0, 3.0, 4.0)), seen(7, cuboid=None, bbox=(1.0, 2.0, 3.0, 4.0))], True),
    ],
    ids=[
        "a car",
        "once",
        "once, in the image",
        "a return beside the road",
        "in the path",
        "no road user",
        "person",
        "carried",
        "nowhere",
        "box",
    ],
)
def test_what_is_worth_a_look_is_proposed(life: list[Seen], is_proposed: bool) -> None:
    found = propose({index: [each] for index, each in enumerate(life)}, {}, BY)
    assert [track.id for track in found.tracks] == ([7] if is_proposed else [])


def test_what_was_seen_once_is_a_box_alone() -> None:
    (track,) = propose({0: [seen(7, bbox=(1.0, 2.0, 3.0, 4.0), score=0.6)]}, {}, BY).tracks
    assert track.sightings[0].cuboid is None
    assert track.sightings[0].bbox == (1.0, 2.0, 3.0, 4.0)
    assert track.confidence == pytest.approx(0.3)


def moment(index: int, speed_mps: float | None = 10.0, reach_m: float = 80.0) -> Moment:
    return Moment(index * 100_000_000, speed_mps, 0.0, reach_m)


@pytest.mark.parametrize(
    ("objects", "reach_m", "lead"),
    [
        ([], 80.0, "none"),
        ([], 40.0, "unknown"),
        ([seen(8, label="car", in_path=True, cuboid=None, bbox=(1.0, 2.0, 3.0, 4.0))], 80.0, "unknown"),
        ([seen(9, label="car", in_path=False)], 80.0, "none"),
    ],
    ids=["seen to be free", "beyond reach", "a car in the path that nobody chose", "a car beside the path"],
)
def test_nobody_leads_only_where_that_could_be_seen(objects: list[Seen], reach_m: float, lead: str) -> None:
    found = propose({0: objects}, {0: None}, BY, {0: moment(0, reach_m=reach_m)})
    assert [each.lead for each in found.leads] == [lead]


def test_a_lead_that_is_no_vehicle_for_sure_is_not_proposed() -> None:
    """The pipeline also brakes for unknown objects; a label states the class."""
    life = {index: [seen(7, label=None, in_path=True)] for index in range(4)}
    found = propose(life, dict.fromkeys(range(4), 7), BY, {index: moment(index) for index in range(4)})
    assert found.tracks == ()
    assert [(each.first, each.last, each.lead) for each in found.leads] == [(0, 3, "unknown")]


def test_what_drives_steadily_is_proposed_without_a_camera_and_a_flickering_wall_is_not() -> None:
    """Both move along at 10 m/s; one always has the size of a car's rear, the other varies between one and three
    metres."""
    rear = [seen(7, label=None, cuboid=Cuboid((20.0, 3.5, 0.6), (0.4, 1.6, 1.2), 0.0)) for _ in range(8)]
    wall = [seen(8, label=None, cuboid=Cuboid((20.0, 9.0, 0.6), (1.0 + 2 * (n % 2), 0.3, 1.2), 0.0)) for n in range(8)]
    frames = {index: [rear[index], wall[index]] for index in range(8)}
    (track,) = propose(frames, {}, BY, {index: moment(index) for index in range(8)}).tracks
    assert (track.id, track.heading, track.confidence) == (7, "motion", 0.5)
    assert propose(frames, {}, BY, {index: moment(index, None) for index in range(8)}).tracks == ()


def test_the_surer_a_detector_and_the_more_often_the_surer_the_proposal() -> None:
    def sure(*scores: float | None) -> float:
        life = {n: [seen(7, label="car" if score else None, score=score)] for n, score in enumerate(scores)}
        (track,) = propose(life, {}, BY).tracks
        assert track.confidence is not None
        return track.confidence

    assert sure(0.9, 0.9) > sure(0.5, 0.5) > sure(0.5, None)
    assert sure(0.5, 0.5, 0.5, 0.5) > sure(0.5, 0.5)


def test_a_track_has_the_name_it_was_called_most_and_ends_where_it_was_last_seen() -> None:
    life = [seen(7, label="car"), seen(7, label=None, carried=True), seen(7, label="truck"), seen(7, label="truck")]
    life += [seen(7, label="truck", carried=True)]
    (track,) = propose({index: [each] for index, each in enumerate(life)}, {}, BY).tracks
    assert (track.label, frames_of(track)) == ("truck", [0, 1, 2, 3])
    assert not any(each.keyframe for each in track.sightings)


def test_a_vehicle_is_proposed_whole_and_of_one_size_and_what_was_seen_of_it_stays() -> None:
    """Its rear was seen in two frames, its side in one."""
    rear, side = Cuboid((20.0, 0.0, 0.5), (0.3, 1.6, 1.1), 0.0), Cuboid((20.0, 0.0, 0.6), (5.0, 1.7, 1.3), 0.0)
    life = {0: [seen(7, cuboid=rear)], 1: [seen(7, cuboid=rear)], 2: [seen(7, cuboid=side)], 3: [seen(7, cuboid=side)]}
    (track,) = propose(life, {}, BY).tracks
    found = [each.cuboid for each in track.sightings if each.cuboid is not None]
    assert {each.size for each in found} == {(5.0, 1.8, 1.5)}
    assert [each.center[0] - each.size[0] / 2 for each in found] == pytest.approx([19.85, 19.85, 17.5, 17.5])
    assert [each.center[2] - each.size[2] / 2 for each in found] == pytest.approx([-0.05, -0.05, -0.05, -0.05])


@pytest.mark.parametrize(
    ("label", "size", "is_kept"),
    [
        ("car", (34.4, 5.0, 3.5), False),
        ("car", (7.4, 2.3, 2.9), True),
        ("car", (4.5, 4.0, 1.5), False),
        ("car", (4.5, 1.8, 4.5), False),
        ("truck", (18.7, 2.6, 4.0), True),
    ],
)
def test_a_cluster_larger_than_any_of_its_class_has_a_box_alone(
    label: str, size: tuple[float, float, float], is_kept: bool
) -> None:
    """Its centre is that of the hedge beside it."""
    large, box = Cuboid((27.0, 9.0, 0.7), size, 0.0), (500.0, 300.0, 560.0, 340.0)
    life = {index: [seen(7, label=label, bbox=box, in_path=True)] for index in range(4)}
    life[2] = [seen(7, label=label, bbox=box, cuboid=large)]
    (track,) = propose(life, {}, BY).tracks
    assert [each.cuboid is not None for each in track.sightings] == [True, True, is_kept, True]
    assert all(each.bbox == box for each in track.sightings)
    only = propose({index: [seen(7, label=label, cuboid=large, in_path=True)] for index in range(4)}, {0: 7}, BY)
    assert [each.lead for each in only.leads] == [7 if is_kept else "unknown"], "what is nowhere is not proposed"


def test_one_size_is_no_larger_than_the_class() -> None:
    """A car with an open door in every frame."""
    wide = Cuboid((20.0, 0.0, 0.7), (4.0, 3.0, 1.5), 0.0)
    (track,) = propose({index: [seen(7, cuboid=wide)] for index in range(3)}, {}, BY).tracks
    assert {each.cuboid.size for each in track.sightings if each.cuboid is not None} == {(4.5, 2.6, 1.5)}


def test_who_leads_is_one_range_as_long_as_it_stays_the_same() -> None:
    frames = {index: [seen(7), seen(8)] for index in range(6)}
    moments = {index: moment(index) for index in range(6)}
    found = propose(frames, {0: 7, 1: 7, 2: None, 3: 8, 4: 8, 5: 7}, BY, moments)
    assert [(each.first, each.last, each.lead) for each in found.leads] == [
        (0, 1, 7), (2, 2, "none"), (3, 4, 8), (5, 5, 7),
    ]  # fmt: skip
    names = tuple(map(str, range(6)))
    check(LabelSet("test", names, tuple(range(6)), found.tracks, found.leads), "proposals")


# ------------------------------------------------------------ known already


def track(number: int, places: dict[int, float], *, y: float = 0.0, size: float = 4.0) -> LabelTrack:
    sightings = tuple(Sighting(f, Cuboid((x, y, 0.7), (size, 1.8, 1.5), 0.0)) for f, x in places.items())
    return LabelTrack(number, "car", sightings, "accepted", BY)


def boxed(number: int, x1: float) -> LabelTrack:
    return LabelTrack(number, "car", (Sighting(0, None, (x1, 0.0, x1 + 10.0, 10.0)),), "accepted", BY)


@pytest.mark.parametrize(
    ("mine", "theirs", "same"),
    [
        (track(7, {0: 20.0, 1: 21.0}), track(3, {0: 20.5, 1: 21.5, 2: 90.0}), {7: 3}),
        (track(7, {0: 20.0}), track(3, {0: 25.0}), {}),
        (track(7, {0: 20.0}, y=3.5), track(3, {0: 20.0}), {}),
        (track(7, {0: 20.0, 1: 21.0, 2: 22.0}), track(3, {0: 20.0, 1: 31.0, 2: 32.0}), {}),
        (track(7, {0: 20.0}), track(3, {1: 20.0}), {}),
        (track(7, {0: 18.2}, size=0.4), track(3, {0: 20.0}), {7: 3}),
        (boxed(7, 0.0), boxed(3, 2.0), {7: 3}),
        (boxed(7, 0.0), boxed(3, 8.0), {}),
        (boxed(7, 0.0), track(3, {0: 20.0}), {}),
    ],
    ids=[
        "near",
        "far",
        "the next lane",
        "once in three",
        "never together",
        "only its rear",
        "boxes",
        "other",
        "unlike",
    ],
)
def test_two_are_the_same_when_they_mostly_are_in_one_place(
    mine: LabelTrack, theirs: LabelTrack, same: dict[int, int]
) -> None:
    assert known_as([mine], [theirs]) == same


def test_one_labelled_vehicle_is_one_proposal() -> None:
    proposals = [track(7, {0: 20.0}), track(8, {0: 20.5, 1: 20.5})]
    assert known_as(proposals, [track(3, {0: 20.0, 1: 20.5})]) == {8: 3}
