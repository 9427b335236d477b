"""The boxes that a 3D view gets are those of the result."""

from __future__ import annotations

import math
from typing import Any

import pytest

from pipeline.recording import topics
from pipeline.recording.session.scene_update import objects_message


def seen(number: int, **more: Any) -> dict[str, Any]:
    bev = [[14.0, 1.0], [14.0, -1.0], [10.0, -1.0], [10.0, 1.0]]
    return {"id": number, "source": "VL", "type": "car", "distance_m": 10.0, "cuboid": None, "bev": bev, **more}


def scene(*objects: dict[str, Any], lead: int | None = None) -> Any:
    result = {"objects": list(objects), "cipv": None if lead is None else {"id": lead}}
    return topics.message_class(topics.OBJECTS).FromString(objects_message(result, 5_000_000_001))


def test_a_cuboid_is_drawn_where_it_is() -> None:
    cuboid = {"center": [12.0, 0.5, 0.2], "size": [4.0, 1.8, 1.5], "yaw_rad": 0.4}
    (entity,) = scene(seen(7, cuboid=cuboid)).entities
    (cube,) = entity.cubes
    place, turned = cube.pose.position, cube.pose.orientation
    assert (place.x, place.y, place.z) == (12.0, 0.5, 0.2)
    assert (cube.size.x, cube.size.y, cube.size.z) == (4.0, 1.8, 1.5)
    assert 2.0 * math.atan2(turned.z, turned.w) == pytest.approx(0.4)
    assert (entity.frame_id, entity.timestamp.seconds, entity.timestamp.nanos) == ("ego", 5, 1)


def test_what_only_the_camera_sees_is_flat() -> None:
    (entity,) = scene(seen(7)).entities
    (cube,) = entity.cubes
    assert (cube.pose.position.x, cube.pose.position.y) == (12.0, 0.0)
    assert (cube.size.x, cube.size.y) == (4.0, 2.0)
    assert cube.size.z < 0.2


def test_the_lead_is_named_and_coloured() -> None:
    lead, other = scene(seen(7), seen(8, source="L", type=None, distance_m=None), lead=7).entities
    assert lead.texts[0].text == "CIPV #7 car 10.0 m"
    assert other.texts[0].text == "#8 L"
    assert lead.cubes[0].color != other.cubes[0].color


def test_objects_without_a_place_are_not_drawn_and_old_ones_go() -> None:
    update = scene(seen(7, bev=None))
    assert not update.entities
    assert [deletion.type for deletion in update.deletions] == [1]
