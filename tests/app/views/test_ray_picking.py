"""A click into the scene: the object that its ray meets first."""

from __future__ import annotations

import pytest

from app.views.ray_picking import MARGIN_M, object_on_ray
from pipeline.types import Point3, Result

DOWN: Point3 = (0.0, 0.0, -1.0)
AHEAD: Point3 = (1.0, 0.0, 0.0)
RAYS: dict[str, tuple[Point3, Point3, int | None]] = {
    "from above onto the lead": ((22.0, 0.2, 30.0), DOWN, 7),
    "from above beside everything": ((22.0, -6.0, 30.0), DOWN, None),
    "a little beside the pole": ((15.0, 6.2 + 0.9 * MARGIN_M, 30.0), DOWN, 8),
    "too far beside the pole": ((15.0, 6.2 + 1.1 * MARGIN_M, 30.0), DOWN, None),
    "along the road": ((0.0, 0.2, -0.5), AHEAD, 7),
    "the other way": ((0.0, 0.2, -0.5), (-1.0, 0.0, 0.0), None),
    "over its roof": ((0.0, 0.2, 3.0), AHEAD, None),
    "onto a truck that only the camera sees": ((46.0, 7.8, 30.0), DOWN, 9),
    "at the truck's side, as high as a car": ((46.0, 0.0, 0.0), (0.0, 1.0, 0.0), 9),
    "the pole stands before the truck": ((0.0, 5.2, 0.0), (45.0, 2.4, 0.0), 8),
    "slanted, from the follow camera": ((-16.0, 0.0, 9.0), (38.0, 0.2, -9.5), 7),
}


@pytest.mark.parametrize("name", RAYS)
def test_the_first_object_on_the_ray(result: Result, name: str) -> None:
    origin, direction, number = RAYS[name]
    assert object_on_ray(result.objects, origin, direction, -1.2) == number


def test_an_object_that_is_nowhere_is_not_met(result: Result) -> None:
    nowhere = tuple(each for each in result.objects if each.bev is None)
    assert nowhere
    assert object_on_ray(nowhere, (0.0, 0.0, 0.0), AHEAD, 0.0) is None
