"""Tracks of a further ranging sensor join the objects at their place."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from pipeline.fusion.fuse import Fusion, FusionState, fuse
from pipeline.params import FusionParams
from pipeline.types import FusedObject, RangedTrack
from tests.pipeline.build import lidar_track, vision_track
from tests.pipeline.ranging.declared import radar_declared

BOX = (600.0, 300.0, 640.0, 330.0)


@pytest.fixture(autouse=True)
def radar() -> Iterator[None]:
    with radar_declared():
        yield


def radar_track(number: int, x: float, y: float = 0.0, carried: bool = False) -> RangedTrack:
    return RangedTrack(number, (x, y), (0.15, 0.3), (-5.0, 0.0), 4, carried, 4)


def objects(state: FusionState, **tracks: tuple) -> tuple[FusionState, tuple[FusedObject, ...]]:
    """Without an alignment: boxes and clusters are not compared."""
    state, fusion = fuse(
        state,
        tracks.get("lidar", ()),
        tracks.get("vision", ()),
        None,
        None,
        FusionParams(),
        {"R": tracks.get("radar", ())},
    )
    assert isinstance(fusion, Fusion)
    return state, fusion.objects


def test_it_ranges_what_the_camera_sees() -> None:
    _, (item,) = objects(FusionState(), vision=(vision_track(1, BOX, 60.0, 6.0),), radar=(radar_track(1, 54.0),))
    assert (item.source, item.label, item.distance_m, item.velocity_mps) == ("VR", "car", 54.0, (-5.0, 0.0))
    assert item.ranged
    assert item.distance_from == "radar"
    assert item.ranged_hits == 4
    assert item.height_from is None


def test_the_lidars_range_counts_where_both_have_one() -> None:
    _, (item,) = objects(FusionState(), lidar=(lidar_track(1, 30.0),), radar=(radar_track(1, 30.6),))
    assert (item.source, item.seen_by, item.distance_m, item.distance_from) == ("LR", "LR", 30.0, "cluster")


@pytest.mark.parametrize(("x", "y"), [(60.0, 3.5), (33.0, 0.0)])
def test_what_is_elsewhere_is_another_object(x: float, y: float) -> None:
    _, both = objects(FusionState(), vision=(vision_track(1, BOX, 60.0, 6.0),), radar=(radar_track(1, x, y),))
    assert sorted(each.source for each in both) == ["R", "V"]
    alone = next(each for each in both if each.source == "R")
    assert (alone.label, alone.hits, alone.existence) == (None, 4, None)


def test_one_pair_that_fits_is_preferred_to_two_that_hardly_do() -> None:
    """The radar sees the farther car and one beyond it; the nearer car is hidden from it."""
    cars, echoes = (lidar_track(1, 30.0), lidar_track(2, 28.3)), (radar_track(1, 29.7), radar_track(2, 31.5))
    _, found = objects(FusionState(), lidar=cars, radar=echoes)
    assert sorted((each.source, each.lidar_track) for each in found if each.lidar_track) == [("L", 2), ("LR", 1)]
    assert sum(each.source == "R" for each in found) == 1


def test_an_object_keeps_its_id_from_sensor_to_sensor() -> None:
    state, (first,) = objects(FusionState(), radar=(radar_track(1, 54.0),))
    state, (second,) = objects(state, vision=(vision_track(7, BOX, 60.0, 6.0),), radar=(radar_track(1, 53.0),))
    _, (third,) = objects(state, vision=(vision_track(7, BOX, 60.0, 6.0),))
    assert first.id == second.id == third.id
    assert [each.source for each in (first, second, third)] == ["R", "VR", "V"]


def test_a_carried_track_is_no_sighting() -> None:
    _, (item,) = objects(FusionState(), radar=(radar_track(1, 54.0, carried=True),))
    assert (item.source, item.seen_by, item.carried, item.measured) == ("R", "", True, False)


@pytest.mark.parametrize("also", [(), (radar_track(1, 30.6),)])
def test_the_lidars_velocity_comes_with_its_sigma(also: tuple[RangedTrack, ...]) -> None:
    seen = lidar_track(1, 30.0)._replace(speed_sigma_mps=0.5)
    _, (item,) = objects(FusionState(), lidar=(seen,), radar=also)
    assert item.lidar_speed_sigma_mps == 0.5


def test_a_radars_velocity_does_not_come_with_the_lidars_sigma() -> None:
    unseen = lidar_track(1, 30.0)._replace(speed_sigma_mps=0.5, carried=True)
    state, _ = objects(FusionState(), lidar=(lidar_track(1, 30.0),), radar=(radar_track(1, 30.6),))
    _, (item,) = objects(state, lidar=(unseen,), radar=(radar_track(1, 30.6),))
    assert (item.velocity_mps, item.lidar_speed_sigma_mps) == ((-5.0, 0.0), None)
