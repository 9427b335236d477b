"""Cars that stand across the direction in which they were proposed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.common.geometry import Cuboid
from pipeline.labels.cuboids.across import turned_across
from pipeline.labels.cuboids.points_of import Clustered, clustered
from pipeline.labels.cuboids.refine import refined
from pipeline.labels.headings import Pose
from pipeline.labels.model import LabelTrack
from tests.pipeline.labels.cuboids.test_refine import iou, track_of
from tests.pipeline.labels.test_measured import standing, sweep_of

ACROSS_RAD = -math.pi / 2
"""Its right side faces the sensor, its rear the road."""
PARKED = standing(20.0, -8.0, ACROSS_RAD)


def scene(*cars: Cuboid, faces: str = "both") -> Clustered:
    return clustered(np.vstack([sweep_of(car, faces=faces) for car in cars]))


def along(car: Cuboid) -> Cuboid:
    """The box that is proposed where only its corner nearest to the road is believed: along the road."""
    x, y, _ = car.center
    return standing(x - 0.9 + 2.05, y + 2.2 - 0.9, 0.0, (4.1, 1.8, 1.5))


def is_turned(before: LabelTrack, after: LabelTrack) -> bool:
    turns = [
        a.cuboid.yaw_rad - b.cuboid.yaw_rad
        for a, b in zip(after.sightings, before.sightings, strict=True)
        if a.cuboid and b.cuboid
    ]
    return all(abs(math.remainder(turn, math.pi)) > math.pi / 4 for turn in turns)


def test_a_face_wider_than_any_car_is_a_side() -> None:
    track = track_of({0: along(PARKED)})
    (turned,) = turned_across([track], {0: scene(PARKED)}.get, {})
    assert is_turned(track, turned)
    cuboid = turned.sightings[0].cuboid
    assert cuboid is not None
    corners = [np.array(each)[:, :2] for each in (cuboid.corners(), along(PARKED).corners())]
    nearest = [min(each.tolist(), key=lambda xy: math.hypot(*xy)) for each in corners]
    assert nearest[0] == pytest.approx(nearest[1]), "the seen corner stays"
    (fitted,) = refined([track], {0: scene(PARKED)}.get, {})
    assert fitted.sightings[0].cuboid is not None
    assert iou(fitted.sightings[0].cuboid, PARKED) > 0.85


@pytest.mark.parametrize("size", [(8.0, 1.8, 1.5), (2.0, 1.8, 1.5)])
def test_a_wall_and_what_is_as_wide_as_a_rear_tell_nothing(size: tuple[float, float, float]) -> None:
    other = standing(20.0, -8.0, ACROSS_RAD, size)
    track = track_of({0: standing(21.0, -8.0, 0.0, (4.1, 1.8, 1.5))})
    assert turned_across([track], {0: scene(other)}.get, {}) == (track,)


def test_a_car_whose_long_side_lies_along_stays() -> None:
    car = standing(20.0, 4.0)
    track = track_of({0: car})
    assert turned_across([track], {0: scene(car)}.get, {}) == (track,)


def test_who_drives_goes_where_it_drives() -> None:
    track = replace(track_of({0: along(PARKED)}), heading="motion")
    assert turned_across([track], {0: scene(PARKED)}.get, {}) == (track,)


def test_cars_beside_each_other_are_parallel_as_far_as_the_row_goes() -> None:
    """Of the second and third, only the rear is seen; a fourth one is 10 m away."""
    row = [PARKED, *(standing(x, -8.0, ACROSS_RAD) for x in (23.0, 26.0, 36.0))]
    sweep = clustered(np.vstack([sweep_of(car, faces="both" if car is PARKED else "rear") for car in row]))
    tracks = [replace(track_of({0: along(car)}), id=number) for number, car in enumerate(row)]
    turned = turned_across(tracks, {0: sweep}.get, {})
    assert [is_turned(*pair) for pair in zip(tracks, turned, strict=True)] == [True, True, True, False]


def test_a_person_between_cars_turns_none() -> None:
    """Nor does a parked truck, whose box is no better known."""
    car, other = standing(20.0, 4.0), standing(22.0, 6.5, math.pi / 2)
    seen = {0: scene(car, faces="rear")}
    tracks = [track_of({0: car}), replace(track_of({0: other}), id=2, label="person")]
    assert turned_across(tracks, seen.get, {})[0] == tracks[0]
    assert turned_across([tracks[0], replace(tracks[1], label="truck")], seen.get, {})[0] == tracks[0]
    driving = replace(tracks[1], label="truck", heading="motion")
    assert is_turned(tracks[0], turned_across([tracks[0], driving], seen.get, {})[0])


def test_a_track_has_one_axis_over_ground() -> None:
    """Its box was across in one frame; the car turned by 60° meanwhile, so that another seems to be."""
    cars = {0: standing(20.0, 4.0), 1: standing(19.0, 4.0), 2: standing(18.0, 4.0, math.radians(-60.0))}
    poses = {at: Pose(1, float(at), 0.0, math.radians(60.0) * (at == 2), float(at), at * 0.1) for at in cars}
    boxes = cars | {1: standing(19.0, 4.0, math.pi / 2)}
    track = track_of(boxes)
    (found,) = turned_across([track], {at: scene(car) for at, car in cars.items()}.get, poses)
    yaws = [each.cuboid.yaw_rad for each in found.sightings if each.cuboid]
    assert [math.remainder(yaw, math.pi) for yaw in yaws] == pytest.approx([0.0, 0.0, math.radians(-60.0)], abs=1e-6)


def test_without_points_nothing_is_turned() -> None:
    track = track_of({0: along(PARKED)})
    assert turned_across([track], lambda _: None, {}) == (track,)
