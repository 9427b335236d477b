"""Attributes of a track."""

from __future__ import annotations

import pytest

from app.labels.errors import ActRefused, BadAct
from app.labels.store.drive_labels import DriveLabels
from tests.app.labels.acts.doing import act, track


def said(labels: DriveLabels, number: int = 1) -> list[tuple[int, int, str, str]]:
    return [(each.first, each.last, each.name, each.value) for each in track(labels, number).attributes]


def put(labels: DriveLabels, name: str, value: str | None, first: int, last: int) -> None:
    act(labels, kind="set_attribute", track=1, name=name, value=value, first=first, last=last)


def test_ranges_of_one_attribute_take_the_place_of_what_they_cover_and_join(labels: DriveLabels) -> None:
    put(labels, "motion", "moving", 10, 20)
    put(labels, "motion", "stopped", 13, 15)
    put(labels, "brake lights", "on", 12, 14)
    assert said(labels) == [
        (12, 14, "brake lights", "on"),
        (10, 12, "motion", "moving"),
        (13, 15, "motion", "stopped"),
        (16, 20, "motion", "moving"),
    ]
    put(labels, "motion", "stopped", 16, 17)
    assert said(labels)[1:] == [
        (10, 12, "motion", "moving"),
        (13, 17, "motion", "stopped"),
        (18, 20, "motion", "moving"),
    ]
    put(labels, "motion", None, 11, 30)
    assert said(labels)[1:] == [(10, 10, "motion", "moving")]
    assert track(labels).state == "corrected"
    labels.log.move("undo", "Ada")
    assert len(said(labels)) == 4


def test_occlusion_and_truncation_are_of_each_frame(labels: DriveLabels) -> None:
    put(labels, "occlusion", "2", 12, 13)
    put(labels, "truncation", "0.25", 13, 14)
    seen = {each.frame: (each.occlusion, each.truncation) for each in track(labels).sightings}
    assert [seen[frame] for frame in range(11, 16)] == [(None, None), (2, None), (2, 0.25), (None, 0.25), (None, None)]
    with pytest.raises(ActRefused, match="is not in frames 1–3"):
        put(labels, "occlusion", "1", 0, 2)


def test_what_the_list_has_not_is_refused(labels: DriveLabels) -> None:
    with pytest.raises(BadAct, match="no attribute 'colour'"):
        put(labels, "colour", "red", 10, 12)
    with pytest.raises(BadAct, match="motion must be one of moving, stopped, parked, not 'flying'"):
        put(labels, "motion", "flying", 10, 12)


def test_a_split_track_shares_what_is_said_and_a_merged_one_has_both(labels: DriveLabels) -> None:
    put(labels, "motion", "moving", 10, 20)
    act(labels, kind="split", track=1, frame=15)
    assert (said(labels, 1), said(labels, 3)) == ([(10, 14, "motion", "moving")], [(15, 20, "motion", "moving")])
    refs = [{"id": number, "revision": labels.track(number).revision} for number in (1, 3)]
    act(labels, kind="merge", tracks=refs)
    assert said(labels, 1) == [(10, 14, "motion", "moving"), (15, 20, "motion", "moving")]


def test_a_sub_class_stays_one(labels: DriveLabels) -> None:
    act(labels, kind="relabel", track=1, label="Van")
    assert track(labels).label == "van"
    act(labels, kind="relabel", track=1, label="lorry")
    assert track(labels).label == "truck"
