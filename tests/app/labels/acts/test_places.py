"""Where a vehicle is: keyframes, sightings, sizes."""

from __future__ import annotations

import pytest

from app.labels.errors import ActRefused
from app.labels.store.drive_labels import DriveLabels
from tests.app.labels.acts.doing import BOX, act, track


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
