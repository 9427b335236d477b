"""Which box belongs to which cluster while nobody knows how the camera is turned, and by which angle they differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.alignment.projection import resolve
from pipeline.fusion.drift.compare import Offset, offsets
from pipeline.params import AlignmentParams
from pipeline.types import LidarTrack, VisionMeasurement
from tests.pipeline.calibration.alignment.made_drive import CAMERA, SIZE
from tests.pipeline.fusion.drift.traffic import PLACES, box, track

RIGHT = AlignmentParams()


def told(
    tracks: list[LidarTrack], boxes: list[VisionMeasurement], held: tuple[float, float] = (0.0, 0.0)
) -> list[Offset]:
    aligned = resolve(AlignmentParams(), CAMERA)
    assert aligned is not None
    return offsets(tracks, boxes, aligned, SIZE, held)


def test_every_vehicle_shows_the_angle_of_a_turned_camera():
    turned = AlignmentParams(yaw_deg=-2.0, pitch_deg=1.0)
    found = told([track(k, *place) for k, place in enumerate(PLACES)], [box(*place, turned) for place in PLACES])
    assert {each.track for each in found} == set(range(len(PLACES)))
    for each in found:
        assert each.yaw_deg == pytest.approx(-2.0, abs=0.15)
        assert each.pitch_deg == pytest.approx(1.0, abs=0.15)


def test_a_box_of_a_neighbour_is_not_taken_when_the_others_disagree():
    """Two cars are 3° apart and the camera is turned by 3°: the box of one lies on the other."""
    places = ((32.0, 0.0), (32.0, 1.7), (20.0, -5.0), (15.0, 5.0))
    boxes = [box(*place, AlignmentParams(yaw_deg=3.0)) for place in places]
    found = told([track(k, *place) for k, place in enumerate(places)], boxes)
    assert [each.yaw_deg for each in found] == pytest.approx([3.0] * 4, abs=0.25)


def test_the_side_of_a_vehicle_that_the_lidar_does_not_hit_is_no_angle():
    places = ((14.0, -3.5), (20.0, -3.6), (27.0, 3.4))
    found = [each for place in places for each in told([track(0, *place)], [box(*place, RIGHT, length_m=4.5)])]
    assert len(found) == 3
    assert [each.yaw_deg for each in found] == pytest.approx([0.0] * 3, abs=0.15)


@pytest.mark.parametrize("radius_m", [60.0, -60.0])
def test_vehicles_that_are_all_turned_by_a_bend_are_no_angle(radius_m: float):
    """Each shows its outer side, whose far end is the outer edge of its box."""
    on_arc = [
        (abs(radius_m) * np.sin(at_m / abs(radius_m)), radius_m * (1.0 - np.cos(at_m / radius_m)), at_m / radius_m)
        for at_m in (12.0, 20.0, 28.0)
    ]
    pairs = [
        (track(0, x, y, heading_rad=turned), box(x, y, RIGHT, length_m=4.5, heading_rad=turned))
        for x, y, turned in on_arc
    ]
    found = [each for hit, drawn in pairs for each in told([hit], [drawn])]
    assert len(found) == 3
    assert [each.yaw_deg for each in found] == pytest.approx([0.0] * 3, abs=0.25)


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["left", "right"])
def test_an_edge_that_a_nearer_vehicle_may_hide_is_none(side: float):
    """The detector ends the box of a parked car where the box of a nearer one begins; the LiDAR, mounted
    elsewhere, sees more of it. The outer edge, at its near face, is the one that tells the yaw."""
    whole, hit = box(24.0, 6.0 * side, RIGHT, length_m=4.5), track(1, 24.0, 6.0 * side)
    x1, y1, x2, y2 = whole.detection.bbox
    hidden = 0.25 * (x2 - x1)
    part = (x1 + hidden, y1, x2, y2) if side > 0.0 else (x1, y1, x2 - hidden, y2)
    cut = replace(whole, detection=replace(whole.detection, bbox=part))
    outside, inside = box(14.0, 4.6 * side, RIGHT), box(14.0, 1.7 * side, RIGHT)
    assert abs(told([hit], [cut])[0].yaw_deg) > 1.0
    assert told([hit], [cut, outside]) == []
    assert told([hit], [whole, inside])[0].yaw_deg == pytest.approx(0.0, abs=0.15)


def test_a_cluster_that_may_show_either_side_tells_no_yaw():
    """Turned by 2° against the line of sight, and narrower than its box."""
    seen, hit = box(20.0, 0.7, AlignmentParams(), length_m=8.0), track(1, 20.0, 0.7)
    narrow = hit.obstacle.cuboid._replace(size=(0.2, 1.4, 1.5))
    assert told([hit._replace(obstacle=hit.obstacle._replace(cuboid=narrow))], [seen]) == []


@pytest.mark.parametrize("what", ["carried", "new", "narrow", "passed", "cut", "not sure", "no vehicle", "too high"])
def test_what_tells_nothing(what: str):
    hit, seen = track(1, 18.0, 0.5), box(18.0, 0.5, AlignmentParams())
    cuboid, detection = hit.obstacle.cuboid, seen.detection
    x1, y1, x2, y2 = detection.bbox
    hit, seen = {
        "carried": (hit._replace(carried=True), seen),
        "new": (hit._replace(hits=1), seen),
        "narrow": (hit._replace(obstacle=hit.obstacle._replace(cuboid=cuboid._replace(size=(0.2, 0.9, 1.5)))), seen),
        "passed": (hit._replace(velocity_mps=(0.0, 12.0)), seen),
        "cut": (hit, replace(seen, detection=replace(detection, bbox=(x1, y1, x2, float(SIZE[1]))))),
        "not sure": (hit, replace(seen, detection=replace(detection, score=0.2))),
        "no vehicle": (hit, replace(seen, detection=replace(detection, label="person"))),
        "too high": (hit, replace(seen, detection=replace(detection, bbox=(x1, y1 - 4 * (y2 - y1), x2, y2)))),
    }[what]
    assert told([hit], [seen]) == []
    assert len(told([track(1, 18.0, 0.5)], [box(18.0, 0.5, AlignmentParams())])) == 1


@pytest.mark.parametrize(("width_m", "is_paired"), [(1.8, True), (2.15, False)])
def test_a_cluster_wider_than_its_box_contains_something_else(width_m: float, is_paired: bool):
    hit = track(1, 18.0, 4.0)
    wide = hit.obstacle._replace(cuboid=hit.obstacle.cuboid._replace(size=(0.2, width_m, 1.5)))
    found = told([hit._replace(obstacle=wide)], [box(18.0, 4.0, AlignmentParams())])
    assert bool(found) is is_paired
