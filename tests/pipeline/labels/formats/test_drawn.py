"""What Foxglove shows of labels: a message of each kind a frame, in Foxglove's own schemas."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from pipeline.common.geometry import Cuboid
from pipeline.labels.boxes import following
from pipeline.labels.formats.drawn import drawn
from pipeline.labels.model import LabelSet, LabelTrack, LeadRange, Sighting
from pipeline.recording import topics
from tests.pipeline.labels.formats.sets import COUNT, IMPORT, drive

AHEAD = Cuboid((20.0, 1.0, 0.7), (4.2, 1.8, 1.5), 0.5)


def labels() -> LabelSet:
    car = LabelTrack(7, "car", (Sighting(1, AHEAD), Sighting(2, AHEAD)), "accepted", IMPORT)
    boxed = LabelTrack(8, "truck", (Sighting(2, None, (10.0, 20.0, 30.0, 50.0)),), "proposed", IMPORT)
    wrong = LabelTrack(9, "car", (Sighting(1, AHEAD),), "rejected", IMPORT)
    return replace(drive().empty(), tracks=(car, boxed, wrong), leads=(LeadRange(2, 5, 7, "accepted", IMPORT),))


def shown(topic: str) -> dict[int, Any]:
    found = drawn(following(labels(), drive()))
    kind = topics.message_class(topic)
    return {frame: kind.FromString(data) for frame, each in found.items() for at, data in each if at == topic}


def test_each_frame_shows_its_cuboids_and_the_one_after_the_last_shows_none() -> None:
    scenes = shown(topics.LABEL_SCENE)
    assert {frame: [each.id for each in scene.entities] for frame, scene in scenes.items()} == {
        1: ["7"],
        2: ["7"],
        3: [],
    }
    assert all(len(scene.deletions) == 1 for scene in scenes.values()), "each takes the place of the one before"
    (entity,) = scenes[2].entities
    (cube,) = entity.cubes
    at, size, turn = cube.pose.position, cube.size, cube.pose.orientation
    assert (at.x, at.y, at.z, size.x, size.y, size.z) == pytest.approx((20.0, 1.0, 0.7, 4.2, 1.8, 1.5))
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(0.5)
    assert (entity.frame_id, entity.texts[0].text) == ("ego", "lead #7 car, accepted")
    assert scenes[1].entities[0].texts[0].text == "#7 car, accepted"
    t_ns = drive().t_ns[2]
    assert (entity.timestamp.seconds, entity.timestamp.nanos) == divmod(t_ns, 10**9)


def test_boxes_are_drawn_in_the_image() -> None:
    images = shown(topics.LABEL_IMAGE)
    (follows,), both = images[1].points, images[2].points
    xs = [each.x for each in follows.points]
    assert len(xs) == 4
    assert 0 < max(xs) - min(xs) < 200, "around the projected cuboid"
    assert [(each.x, each.y) for each in both[1].points] == [(10, 20), (30, 20), (30, 50), (10, 50)]
    assert [each.text for each in images[2].texts] == ["lead #7 car, accepted", "#8 truck, proposed"]
    assert not images[3].points


def test_nothing_is_drawn_of_no_labels() -> None:
    assert drawn(drive().empty()) == {}
    last = replace(
        labels(), tracks=(LabelTrack(1, "car", (Sighting(COUNT - 1, AHEAD),), "accepted", IMPORT),), leads=()
    )
    assert list(drawn(last)) == [COUNT - 1]
