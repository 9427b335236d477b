"""Fusion loses nothing and doubles nothing, joins what belongs together, and keeps its numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.alignment.projection import Alignment, Angular, project_cuboid
from pipeline.common.fast_replace import evolve
from pipeline.fusion.fuse import Fusion, FusionState, Owner, fuse
from pipeline.fusion.vehicle_sizes import LONGEST_M
from pipeline.params import FusionParams, preset
from pipeline.types import Box, LidarTrack, VisionTrack
from tests.pipeline.build import lidar_track, vision_track

ALIGNMENT: Alignment = Angular(np.radians(0.06), np.radians(0.06), 640.0, 360.0)
SIZE = (1280, 720)
OPTIMAL, GREEDY = FusionParams(), preset("paper").fusion


def box_of(track: LidarTrack) -> Box:
    box = project_cuboid(ALIGNMENT, track.obstacle.cuboid.corners(), *SIZE)
    assert box is not None
    return box


def joined(
    lidar: list[LidarTrack], vision: list[VisionTrack], params: FusionParams = OPTIMAL, state: FusionState | None = None
) -> tuple[FusionState, Fusion]:
    return fuse(state or FusionState(), tuple(lidar), tuple(vision), ALIGNMENT, SIZE, params)


boxes = st.tuples(st.floats(0, 1200), st.floats(0, 650), st.floats(0, 300), st.floats(0, 300)).map(
    lambda b: (b[0], b[1], min(b[0] + b[2], 1280.0), min(b[1] + b[3], 720.0))
)
places = st.tuples(st.floats(-10, 60), st.floats(-15, 15))


@pytest.mark.parametrize("params", [OPTIMAL, GREEDY], ids=["optimal", "greedy"])
@given(seen=st.lists(st.tuples(boxes, st.none() | st.floats(3, 100)), max_size=8), hit=st.lists(places, max_size=8))
def test_every_track_lands_in_exactly_one_row(
    params: FusionParams, seen: list[tuple[Box, float | None]], hit: list[tuple[float, float]]
) -> None:
    vision = [vision_track(i + 1, box, distance) for i, (box, distance) in enumerate(seen)]
    # the first box is made to fit the first cuboid, so that pairs do happen
    lidar = [lidar_track(j + 1, x, y) for j, (x, y) in enumerate(hit)]
    if vision and lidar and project_cuboid(ALIGNMENT, lidar[0].obstacle.cuboid.corners(), *SIZE):
        vision[0] = vision_track(1, box_of(lidar[0]), None)
    _, result = joined(lidar, vision, params)
    kinds = [item.source for item in result.objects]
    assert kinds.count("V") + kinds.count("VL") == len(vision)
    assert kinds.count("L") + kinds.count("VL") == len(lidar)
    assert sorted(o.vision_track for o in result.objects if o.vision_track) == [v.id for v in vision]
    assert sorted(o.lidar_track for o in result.objects if o.lidar_track) == [t.id for t in lidar]
    assert len({item.id for item in result.objects}) == len(result.objects)


def test_where_the_sight_lines_past_a_box_end() -> None:
    """At the LiDAR's distance if there is one, otherwise at the camera's; None for objects that the camera does not see
    now."""
    near, far = lidar_track(1, 20.0), vision_track(2, (300.0, 330.0, 400.0, 390.0), 40.0)
    lost = evolve(vision_track(3, (900.0, 330.0, 950.0, 390.0), 30.0), carried=True)
    u1, v1, u2, v2 = box_of(near)
    _, result = joined([near], [vision_track(1, (u1, v1, u2, v2), 26.0), far, lost])
    both, alone, carried = (next(o for o in result.objects if o.vision_track == k) for k in (1, 2, 3))
    for item, box, range_m in ((both, (u1, u2), 20.0), (alone, (300.0, 400.0), 40.0)):
        assert item.box_sides is not None
        for place, u in zip(item.box_sides, box, strict=True):
            assert np.hypot(*place) == pytest.approx(range_m)
            assert np.arctan2(-place[1], place[0]) == pytest.approx(np.radians(0.06) * (u - 640.0))
    assert carried.box_sides is None


def test_one_car_seen_by_both_is_one_row_with_the_lidars_place_and_the_cameras_name() -> None:
    track = lidar_track(1, 20.0, 1.0, velocity=(-2.0, 0.0))
    _, result = joined([track], [vision_track(1, box_of(track), 21.0)])
    (item,) = result.objects
    assert (item.source, item.label, item.distance_m) == ("VL", "car", pytest.approx(np.hypot(20.0, 1.0)))
    assert item.ranged_hits == track.hits
    assert item.velocity_mps == (-2.0, 0.0)
    assert item.bbox == result.lidar_boxes[item.id]
    assert result.vision_boxes[item.id] == box_of(track)


def test_a_far_cluster_of_one_ring_still_meets_its_cars_box() -> None:
    """At 40 m, rings are 1.4 m apart: one ring on a car is a line, and only the gaps above and below make it a box."""
    line = lidar_track(1, 40.0, height=0.1)
    whole = vision_track(1, box_of(lidar_track(2, 40.0, height=1.5)), 40.0)
    _, result = joined([line], [whole])
    assert [item.source for item in result.objects] == ["VL"]
    _, without = joined([line], [whole], FusionParams(ring_gap_deg=0.0))
    assert sorted(item.source for item in without.objects) == ["L", "V"]


def test_boxes_apart_stay_two_objects() -> None:
    track = lidar_track(1, 20.0, 6.0)
    _, result = joined([track], [vision_track(1, (900.0, 300.0, 1000.0, 400.0), 20.0)])
    assert sorted(item.source for item in result.objects) == ["L", "V"]


def test_a_far_car_over_the_roof_of_a_near_one_is_not_joined_with_it() -> None:
    """Their boxes overlap in the image, but their ranges do not; the L row says which test kept them apart."""
    near = lidar_track(1, 15.0)
    x1, y1, x2, y2 = box_of(near)
    far = vision_track(1, (x1 + 20, y1 - 10, x2 - 25, (y1 + y2) / 2), 50.0, sigma_m=3.0)
    _, result = joined([near], [far])
    assert [item.source for item in result.objects] == ["L", "V"]
    gate = next(g for g in result.objects[0].gates if g.name == "range_sigmas")
    assert (gate.passed, gate.limit) == (False, OPTIMAL.range_gate_sigmas)
    _, paper = joined([near], [far], GREEDY)
    assert [item.source for item in paper.objects] == ["VL"]


def test_boxes_of_one_place_and_size_are_one_object_though_the_height_law_errs() -> None:
    """A van taken for a car seems nearer than it is: the LiDAR knows better."""
    van = lidar_track(1, 30.0, height=2.3)
    _, result = joined([van], [vision_track(1, box_of(van), 19.0, sigma_m=1.5)])
    assert [item.source for item in result.objects] == ["VL"]
    assert result.objects[0].distance_m == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("hits", "ranges", "sources"),
    [
        pytest.param(1, 3, ["L", "V"], id="a stray cluster in front of a vehicle that the camera follows"),
        pytest.param(2, 3, ["VL"], id="seen again: the height law errs"),
        pytest.param(1, 2, ["VL"], id="the camera does not know it either"),
    ],
)
def test_a_single_cluster_does_not_contradict_a_settled_camera_track(
    hits: int, ranges: int, sources: list[str]
) -> None:
    cluster = lidar_track(1, 20.0)._replace(hits=hits)
    followed = replace(vision_track(1, box_of(cluster), 40.0, sigma_m=3.0), ranges=ranges)
    _, result = joined([cluster], [followed])
    assert sorted(item.source for item in result.objects) == sources
    off = FusionParams(settled_boxes=False)
    assert [item.source for item in joined([cluster], [followed], off)[1].objects] == ["VL"]
    agrees = replace(followed, distance_m=28.0)
    assert [item.source for item in joined([cluster], [agrees])[1].objects] == ["VL"]


@pytest.mark.parametrize(
    ("hits", "carried", "params", "ranged_m"),
    [
        pytest.param(1, False, OPTIMAL, 40.0, id="seen once"),
        pytest.param(5, False, OPTIMAL, 20.0, id="fits better, and is there"),
        pytest.param(1, True, OPTIMAL, 20.0, id="the old one is gone"),
        pytest.param(1, False, FusionParams(keep_partners=False), 20.0, id="switched off"),
    ],
)
def test_a_box_stays_with_the_cluster_that_it_was_joined_with(
    hits: int, carried: bool, params: FusionParams, ranged_m: float
) -> None:
    """A box that is too tall in one image fits a spurious cluster in front of the lead better than the lead's own."""
    lead, spurious = lidar_track(1, 40.0), lidar_track(2, 20.0)._replace(hits=hits)
    state, result = joined([lead], [vision_track(1, box_of(lead), 40.0)], params)
    assert [item.source for item in result.objects] == ["VL"]
    tall = vision_track(1, box_of(spurious), 24.0, sigma_m=8.0)
    _, result = joined([lead._replace(carried=carried), spurious], [tall], params, state)
    (pair,) = [item for item in result.objects if item.source == "VL"]
    assert pair.distance_m == pytest.approx(ranged_m)
    gates = [gate.passed for item in result.objects for gate in item.gates if gate.name == "cluster_hits"]
    assert all(gates) == (hits > 1 or carried or not params.keep_partners)


@pytest.mark.parametrize(
    ("label", "carried", "who"), [("suitcase", False, 1), ("suitcase", True, 2), ("car", False, 2)]
)
def test_the_cluster_of_a_vehicle_that_is_still_boxed_becomes_nothing_else(label: str, carried: bool, who: int) -> None:
    """A network took the rear of the lead for a suitcase, with a box that fitted the cluster better than the lead's
    own."""
    lead = lidar_track(1, 7.0)
    x1, y1, x2, y2 = box_of(lead)
    car = vision_track(1, (x1, y1, x2, y2), 7.0)
    state, _ = joined([lead], [car])
    loose = replace(car, bbox=(x1 - 60, y1 - 60, x2 + 60, y2), carried=carried)
    better = replace(vision_track(2, (x1, y1, x2, y2), 7.0), label=label)
    _, result = joined([lead], [loose, better], OPTIMAL, state)
    (pair,) = [item for item in result.objects if item.source == "VL"]
    assert pair.vision_track == who


def test_a_box_whose_cluster_goes_on_with_another_box_is_named() -> None:
    """The nearer of two parked cars was not boxed at first, and its cluster was joined with the farther one's box."""
    near = lidar_track(1, 15.0)
    far = vision_track(1, box_of(near), 15.0)
    state, first = joined([near], [far])
    assert first.bereft == {}
    x1, y1, x2, y2 = box_of(near)
    aside = replace(far, bbox=(x1 - 60, y1, x2 - 60, y2))
    own = vision_track(2, box_of(near), 15.0)
    assert joined([near], [aside, own], OPTIMAL, state)[1].bereft == {1: (2, pytest.approx(15.0))}
    unseen = joined([near], [replace(aside, carried=True), own], OPTIMAL, state)[1]
    assert unseen.bereft == {}, "it may be hidden"
    assert joined([near], [aside], OPTIMAL, state)[1].bereft == {}, "nobody else has the cluster"
    assert joined([near], [aside, replace(own, carried=True)], OPTIMAL, state)[1].bereft == {}


@pytest.mark.parametrize(("known", "sources"), [(True, ["VL"]), (False, ["V", "L"])], ids=["joined before", "new"])
def test_a_pair_stays_joined_when_its_overlap_falls_a_little(known: bool, sources: list[str]) -> None:
    """A lorry that is called a car seems to be at half of its distance. With a few rings, the overlap of its cluster
    and its box varies from sweep to sweep."""
    lorry = lidar_track(1, 56.0)
    x1, y1, x2, y2 = box_of(lorry)
    taller = vision_track(1, (x1, y1 - 4.5 * (y2 - y1), x2, y2), 25.0, sigma_m=4.0)
    state, _ = joined([lorry], [replace(taller, bbox=(x1, y1, x2, y2))])
    _, result = joined([lorry], [taller], OPTIMAL, state if known else FusionState())
    assert [item.source for item in result.objects] == sources


def test_a_slightly_better_overlap_is_no_reason_to_change() -> None:
    lead, beside = lidar_track(1, 30.0), lidar_track(2, 29.5, 0.3)._replace(hits=9)
    state, _ = joined([lead], [vision_track(1, box_of(lead), 30.0)])
    seen = vision_track(1, box_of(beside), 29.5)
    for params, track in ((OPTIMAL, 1), (FusionParams(keep_partners=False), 2)):
        _, result = joined([lead, beside], [seen], params, state)
        assert [item.lidar_track for item in result.objects if item.source == "VL"] == [track]


HEDGE_M, LORRY_M = 35.0, 16.5


@pytest.mark.parametrize(
    ("label", "length_m", "params", "sources"),
    [
        ("car", 4.5, OPTIMAL, ["VL"]),
        ("car", HEDGE_M, OPTIMAL, ["L", "V"]),
        ("car", LORRY_M, OPTIMAL, ["L", "V"]),
        ("truck", LORRY_M, OPTIMAL, ["VL"]),
        ("truck", HEDGE_M, OPTIMAL, ["L", "V"]),
        ("person", 4.5, OPTIMAL, ["L", "V"]),
        ("stop sign", HEDGE_M, OPTIMAL, ["VL"]),
        ("car", HEDGE_M, FusionParams(size_gate=False), ["VL"]),
        ("car", HEDGE_M, GREEDY, ["VL"]),
    ],
)
def test_what_is_longer_than_any_of_its_class_is_not_joined(
    label: str, length_m: float, params: FusionParams, sources: list[str]
) -> None:
    """A hedge beside the road fills the box of the car in front of it; both rows state the hedge's length."""
    track = lidar_track(1, 12.0, 3.0, length=length_m)
    _, result = joined([track], [vision_track(1, box_of(track), None, label=label)], params)
    assert sorted(item.source for item in result.objects) == sources
    if sources != ["VL"]:
        for item in result.objects:
            gate = next(gate for gate in item.gates if gate.name == "class_size")
            assert (gate.passed, gate.value, gate.limit) == (False, length_m, LONGEST_M[label])


def test_optimal_assignment_beats_first_come_first_served() -> None:
    """Two cars side by side, and one box across both: greedy assignment gives it the better half, and the other car's
    box gets nothing."""
    left, right = lidar_track(1, 20.0, 1.1), lidar_track(2, 20.0, -1.1)
    a, b = box_of(left), box_of(right)
    shift = (b[0] - a[0]) * 0.45
    between = vision_track(1, (a[0] + shift, a[1], a[2] + shift, a[3]))
    on_left = vision_track(2, (a[0] - 5, a[1], a[2] - 5, a[3]))
    _, greedy = joined([left, right], [between, on_left], GREEDY)
    _, optimal = joined([left, right], [between, on_left], FusionParams(min_iou=0.05))
    assert sorted(item.source for item in greedy.objects) == ["L", "V", "VL"]
    assert sorted(item.source for item in optimal.objects) == ["VL", "VL"]


def test_without_an_image_every_track_keeps_its_row() -> None:
    _, result = fuse(FusionState(), (lidar_track(1, 20.0),), (vision_track(1, (0, 0, 9, 9)),), ALIGNMENT, None, OPTIMAL)
    assert sorted(item.source for item in result.objects) == ["L", "V"]


def test_a_vision_object_without_distance_keeps_its_row_last() -> None:
    _, result = joined([lidar_track(1, 50.0, -9.0)], [vision_track(1, (0, 0, 9, 9), None)])
    assert [item.source for item in result.objects] == ["L", "V"]
    assert result.objects[1].distance_m is None
    assert result.objects[1].bev is None


def test_an_object_keeps_its_number_from_v_to_vl_to_l() -> None:
    track = lidar_track(7, 20.0)
    seen = vision_track(4, box_of(track), 20.5)
    state, first = joined([], [seen])
    state, second = joined([track], [seen], state=state)
    state, third = joined([track], [], state=state)
    assert [f.objects[0].source for f in (first, second, third)] == ["V", "VL", "L"]
    assert len({f.objects[0].id for f in (first, second, third)}) == 1


def test_a_fragment_does_not_take_the_number_of_the_whole() -> None:
    """The car's former box is now a fragment, and a new box has its cluster: the id stays with the cluster."""
    track = lidar_track(1, 20.0)
    state, first = joined([track], [vision_track(1, box_of(track))])
    assert [item.source for item in first.objects] == ["VL"]
    fragment = vision_track(1, (0.0, 0.0, 20.0, 20.0))
    _, second = joined([track], [fragment, vision_track(2, box_of(track))], state=state)
    by_box = {item.vision_track: item.id for item in second.objects}
    assert by_box == {1: 2, 2: first.objects[0].id}


@pytest.mark.parametrize(
    ("box_frames", "cluster_frames", "ahead"),
    [
        pytest.param(30, 1, 2, id="the cluster was joined with the older object for one frame"),
        pytest.param(1, 12, 1, id="the box is new, the cluster has long been the older object's"),
    ],
)
def test_an_object_takes_the_number_that_its_tracks_have_had_for_longest(
    box_frames: int, cluster_frames: int, ahead: int
) -> None:
    """The cluster of object 1 is joined with the box of object 2, and the box of object 1 is somewhere else."""
    cluster = lidar_track(1, 34.0)
    aside, on_it = vision_track(1, (900.0, 300.0, 960.0, 350.0), 33.0), vision_track(2, box_of(cluster), 35.0)
    owners = {"V": {1: Owner(1, 40), 2: Owner(2, box_frames)}, "L": {1: Owner(1, cluster_frames)}}
    state, after = joined([cluster], [aside, on_it], state=FusionState(3, owners))
    by_box = {item.vision_track: (item.id, item.source) for item in after.objects}
    assert by_box[2] == (ahead, "VL")
    assert by_box[1] == (1 if ahead == 2 else 3, "V")
    assert state.owner_of("L", 1) == Owner(ahead, cluster_frames + 1 if ahead == 1 else 1)


@pytest.mark.parametrize(
    ("cluster_frames", "box_carried", "cluster_carried", "keeps"),
    [
        pytest.param(12, True, False, "L", id="it has left the image, and the LiDAR follows it"),
        pytest.param(12, False, True, "V", id="it has left the LiDAR's reach"),
        pytest.param(12, False, False, "V", id="both are seen, in different places"),
        pytest.param(12, True, True, "V", id="nobody sees it"),
        pytest.param(2, True, False, "V", id="a cluster that was joined with it for a moment"),
    ],
)
def test_a_parted_object_keeps_its_number_where_it_is_seen(
    cluster_frames: int, box_carried: bool, cluster_carried: bool, keeps: str
) -> None:
    cluster = lidar_track(1, 20.0)._replace(carried=cluster_carried)
    box = replace(vision_track(1, (900.0, 300.0, 960.0, 350.0), 33.0), carried=box_carried)
    owners = {"V": {1: Owner(1, 40)}, "L": {1: Owner(1, cluster_frames)}}
    _, after = joined([cluster], [box], state=FusionState(2, owners))
    assert {item.source: item.id for item in after.objects} == {keeps: 1, "V" if keeps == "L" else "L": 2}


def test_two_numbers_that_become_one_object_keep_the_older_and_part_again_without_a_clash() -> None:
    track = lidar_track(1, 20.0)
    apart = vision_track(1, (900.0, 300.0, 1000.0, 400.0), 20.0)
    state, before = joined([track], [apart])
    older = min(item.id for item in before.objects)
    state, together = joined([track], [vision_track(1, box_of(track), 20.0)], state=state)
    assert [item.id for item in together.objects] == [older]
    _, after = joined([track], [apart], state=state)
    assert len({item.id for item in after.objects}) == 2


def test_an_object_that_the_lidar_has_just_found_keeps_the_cameras_velocity() -> None:
    track = lidar_track(1, 30.0, velocity=None)
    seen = vision_track(1, box_of(track), 30.5)
    closing = evolve(seen, velocity_mps=(-12.0, 0.0))
    _, result = joined([track], [closing])
    assert result.objects[0].source == "VL"
    assert result.objects[0].velocity_mps == (-12.0, 0.0)
    _, later = joined([lidar_track(1, 30.0, velocity=(-11.0, 0.0))], [closing])
    assert later.objects[0].velocity_mps == (-11.0, 0.0), "the LiDAR's own is the better one"


@pytest.mark.parametrize(
    ("case", "shift", "taller_px", "ranged"),
    [
        ("the same place", 0.0, 0.0, True),
        ("two rings saw the lower half, and the camera nods", 0.0, 60.0, True),
        ("two vehicles side by side", 0.6, 0.0, False),
    ],
)
def test_heights_are_learned_where_boxes_overlap_across(
    case: str, shift: float, taller_px: float, ranged: bool
) -> None:
    hit = lidar_track(1, 25.0, 0.0)
    x1, y1, x2, y2 = box_of(hit)
    aside = shift * (x2 - x1)
    seen = vision_track(1, (x1 + aside, y1 - taller_px, x2 + aside, y2 - taller_px / 2), distance_m=25.0)
    fused = joined([hit], [seen])[1]
    assert [item.source for item in fused.objects] == ["VL"], case
    assert (1 in fused.ranged_boxes()) is ranged, case
