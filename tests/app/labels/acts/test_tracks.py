"""Adding, splitting, merging and deleting tracks."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import cast

import pytest

from app.labels.errors import ActRefused
from app.labels.store.draft import Draft
from app.labels.store.drive_labels import DriveLabels
from pipeline.labels.model import LabelTrack, Sighting
from tests.app.labels.acts.doing import act, leads, track


def test_a_new_track_is_a_persons_and_has_a_new_number(labels: DriveLabels) -> None:
    act(labels, kind="add_track", label="vehicle", frame=40, bbox=[1, 2, 30, 40])
    found = track(labels, 3)
    assert (found.label, found.state, found.origin.maker) == ("car", "corrected", "person")
    assert found.sightings == (Sighting(40, None, (1.0, 2.0, 30.0, 40.0), True),)


def test_a_split_track_is_two_and_the_lead_follows(labels: DriveLabels) -> None:
    act(labels, kind="split", track=1, frame=14)
    assert [each.frame for each in track(labels, 1).sightings] == [10, 11, 12, 13]
    assert [each.frame for each in track(labels, 3).sightings] == list(range(14, 21))
    assert [each[:3] for each in leads(labels)] == [(10, 13, 1), (14, 20, 3)]
    with pytest.raises(ActRefused, match="on one side of that frame only"):
        act(labels, kind="split", track=1, frame=14)


def test_merged_tracks_are_the_first_and_the_lead_follows(labels: DriveLabels) -> None:
    refs = [{"id": number, "revision": labels.track(number).revision} for number in (2, 1)]
    act(labels, kind="merge", tracks=refs)
    assert [each.frame for each in track(labels, 2).sightings] == list(range(10, 31))
    assert set(labels.items("track")) == {2}
    assert [each[:3] for each in leads(labels)] == [(10, 20, 2)]
    with pytest.raises(ActRefused, match="with itself"):
        act(labels, kind="merge", tracks=[{"id": 2, "revision": labels.track(2).revision}] * 2)


def test_a_track_is_turned_round_in_every_frame_and_its_heading_is_a_persons(labels: DriveLabels) -> None:
    def unsure(draft: Draft) -> str:
        value = cast("LabelTrack", draft.get("track", 1).value)
        draft.put("track", 1, replace(value, heading="unknown", confidence=0.4))
        return "proposed"

    labels.log.act("propose", "Ada", unsure)
    act(labels, kind="flip", track=1)
    found = track(labels, 1)
    assert {each.cuboid.yaw_rad for each in found.sightings if each.cuboid is not None} == {math.pi}
    assert (found.heading, found.state, found.confidence) == ("", "corrected", None)
    assert not any(each.keyframe for each in found.sightings), "it says nothing of where it is"
    act(labels, kind="flip", track=1)
    assert {each.cuboid.yaw_rad for each in track(labels, 1).sightings if each.cuboid is not None} == {0.0}
    act(labels, kind="add_track", label="car", frame=40, bbox=[1, 2, 30, 40])
    with pytest.raises(ActRefused, match="no cuboid"):
        act(labels, kind="flip", track=3)
