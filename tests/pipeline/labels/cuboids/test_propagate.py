"""A track carried on from one frame: made-up drives, and a street that is labelled."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from pipeline.common.geometry import Cuboid
from pipeline.labels.cuboids.points_of import Clustered, clustered
from pipeline.labels.cuboids.propagate import propagated
from pipeline.labels.formats.base import drive_of
from pipeline.labels.formats.registry import import_labels
from pipeline.labels.headings import Moment, Pose, own_poses
from pipeline.labels.model import Origin, Sighting
from pipeline.sources import open_source
from pipeline.types.source import InParts
from tests.pipeline.labels.cuboids.test_refine import driving, iou, sweeps_in
from tests.pipeline.labels.test_measured import standing, sweep_of

T_NS = tuple(at * 100_000_000 for at in range(30))


def seen(cars: dict[int, Cuboid]) -> Callable[[int], Clustered | None]:
    @lru_cache(None)
    def of(at: int) -> Clustered | None:
        return clustered(sweep_of(cars[at])) if at in cars else None

    return of


def carried(cars: dict[int, Cuboid], start: int, poses: dict[int, Pose], *, forward: bool = True) -> dict[int, Cuboid]:
    found = propagated([Sighting(start, cars[start])], T_NS, seen(cars), poses, forward=forward)
    assert not any(each.keyframe for each in found)
    return {each.frame: each.cuboid for each in found if each.cuboid is not None}


@pytest.mark.parametrize("forward", [True, False])
def test_a_parked_car_and_one_that_drives_along_are_followed_from_one_frame(forward: bool) -> None:
    parked = {at: standing(30.0 - at, 4.0) for at in range(20)}
    along = {at: standing(15.0 + 0.02 * at, 3.0) for at in range(20)}
    for cars in (parked, along):
        found = carried(cars, 0 if forward else 19, driving(1.0, 30), forward=forward)
        assert sorted(found) == (list(range(1, 20)) if forward else list(range(19)))
        assert min(iou(found[at], cars[at]) for at in found) > 0.85


def test_a_moment_without_points_is_bridged_and_a_longer_one_ends_it() -> None:
    cars = {at: standing(30.0 - at, 4.0) for at in range(20)}
    short = {at: car for at, car in cars.items() if at not in range(6, 10)}
    assert sorted(carried(short, 0, driving(1.0, 30))) == list(range(1, 20))
    long = {at: car for at, car in cars.items() if at not in range(4, 17)}
    assert sorted(carried(long, 0, driving(1.0, 30))) == [1, 2, 3], "what was only foreseen at the end is not kept"


def test_it_stops_at_another_vehicle_and_at_another_clip() -> None:
    cars = {at: standing(30.0 - at, 4.0) for at in range(10)} | {at: standing(30.0 - at, 6.5) for at in range(10, 20)}
    assert max(carried(cars, 0, driving(1.0, 30))) == 9, "2.5 m aside is another one"
    stamps = tuple(t + (60_000_000_000 if at >= 5 else 0) for at, t in enumerate(T_NS))
    parked = {at: standing(30.0 - at, 4.0) for at in range(20)}
    found = propagated([Sighting(0, parked[0])], stamps, seen(parked), driving(1.0, 30), forward=True)
    assert [each.frame for each in found] == [1, 2, 3, 4]
    assert propagated([], T_NS, seen(parked), {}, forward=True) == ()


def test_what_a_hand_saw_beside_the_points_stays() -> None:
    """A cuboid drawn 0.3 m beyond its points keeps this offset."""
    cars = {at: standing(30.0 - at, 4.0) for at in range(12)}
    drawn = standing(30.3, 4.0)
    found = propagated([Sighting(0, drawn)], T_NS, seen(cars), driving(1.0, 30), forward=True)
    off = [each.cuboid.center[0] - cars[each.frame].center[0] for each in found if each.cuboid is not None]
    assert off == pytest.approx([0.3] * 11, abs=0.06)


def test_a_street_is_labelled_from_one_frame_a_car(data_dir: Path) -> None:
    """KITTI 0009: each car from the frame in which it is about 18 m away."""
    folder = data_dir / "kitti_0009"
    if not folder.is_dir():
        pytest.skip(f"no KITTI drive at {folder}")
    source = open_source(f"kitti:{folder / '2011_09_26' / '2011_09_26_drive_0009_sync'}")
    t_ns = tuple(source.t_ns(index) for index in range(len(source)))
    labels = import_labels(folder / "label_02.txt", drive_of(source), "kitti-tracking", Origin("import", "x", 0)).labels
    assert isinstance(source, InParts)
    egos = [frame.ego for frame in source.outlines()]
    moments = {
        index: Moment(t_ns[index], ego.speed_mps if ego else None, ego.yaw_rate_radps if ego else None, 0.0)
        for index, ego in enumerate(egos)
    }
    sweeps, poses = sweeps_in(source), own_poses(moments)
    overlaps, wanted = [], 0
    for track in (each for each in labels.tracks if each.label == "car"):
        true = {each.frame: each.cuboid for each in track.sightings if each.cuboid is not None}
        near = {at: each for at, each in true.items() if each.center[0] > 0 and math.hypot(*each.center[:2]) < 50}
        if len(near) < 4:
            continue
        start = min(near, key=lambda at: abs(math.hypot(*near[at].center[:2]) - 18))
        found = [
            each
            for forward in (True, False)
            for each in propagated([Sighting(start, near[start])], t_ns, sweeps, poses, forward=forward)
        ]
        wanted += len(near) - 1
        overlaps += [iou(each.cuboid, near[each.frame]) for each in found if each.cuboid and each.frame in near]
    assert len(overlaps) > 0.5 * wanted, (len(overlaps), wanted)
    assert float(np.median(overlaps)) > 0.88
    assert float((np.array(overlaps) > 0.7).mean()) > 0.95, "parked cars do not move along with us"
