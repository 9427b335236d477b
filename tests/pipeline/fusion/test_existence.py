"""Evidence of boxes for and against an object, how long evidence lasts, and what a sensor cannot observe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.fusion.existence import Existence, ExistenceState, weigh
from pipeline.fusion.last_place import last_place
from pipeline.params import CipvParams, ExistenceParams
from pipeline.types import CameraImage, EgoState, Frame, FusedObject, RawBoxes
from tests.pipeline.build import fused, moment
from tests.pipeline.fusion.ray_towards import FRAME, NOTHING, PARAMS, Rays, after, camera_car, gate, returns


def test_a_surer_box_is_likelier_there_and_repeating_it_does_not_help() -> None:
    nothing = Rays(NOTHING)
    by_score = [after(camera_car(score=score), nothing).existence for score in (0.3, 0.45, 0.6, 0.9)]
    assert by_score == sorted(by_score)  # type: ignore[type-var]
    assert by_score[1] == pytest.approx(0.5)
    assert (
        after(camera_car(score=0.35), nothing, frames=50).existence == after(camera_car(score=0.35), nothing).existence
    )


def test_a_cluster_speaks_for_it_whatever_the_box_says() -> None:
    both = replace(fused(1, 12.0, source="VL"), score=0.3)
    found = after(both, Rays(returns(40.0)))
    assert found.existence is not None
    assert found.existence > 0.9


def test_what_the_lidar_knew_lasts_a_while_when_it_loses_it() -> None:
    state = ExistenceState()
    for item in [fused(1, 12.0, source="VL")] * 5 + [camera_car(score=0.4)]:
        state, (found,) = weigh(state, (item,), Rays(NOTHING), FRAME, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    assert found.existence > 0.9


def seen_through(frames: int = 5) -> ExistenceState:
    state = ExistenceState()
    for _ in range(frames):
        state, (found,) = weigh(state, (camera_car(score=0.7),), Rays(returns(40.0)), FRAME, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    assert found.existence < 0.2
    return state


def existence_after(
    state: ExistenceState, item: FusedObject, frames: int = 1, params: ExistenceParams = PARAMS
) -> float:
    for _ in range(frames):
        state, (found,) = weigh(state, (item,), Rays(NOTHING), FRAME, moment(None, 0.1), params)
    assert found.existence is not None
    return found.existence


def test_that_a_place_was_empty_says_nothing_of_another_place() -> None:
    """The camera's position was reset to one far from where the LiDAR looked through it."""
    car = camera_car(45.0, score=0.7)
    kept = seen_through()
    assert existence_after(kept, car) < 0.5
    begun = ExistenceState({1: kept.known[1]._replace(last=last_place(replace(car, camera_ranges=12)))})
    assert existence_after(begun, replace(car, camera_ranges=1)) > 0.85


def test_a_box_that_gets_another_number_is_no_more_credible() -> None:
    """The LiDAR looked through it for seconds; then its number went to the cluster of its neighbour."""
    box = replace(camera_car(45.0, score=0.7), vision_track=7)
    state = ExistenceState(seen_through().known, {7: 1})
    assert existence_after(state, replace(box, id=2)) < 0.5
    assert existence_after(ExistenceState(state.known), replace(box, id=2)) > 0.85, "without its track, it is new"


def test_a_box_that_gets_another_number_leaves_what_the_lidar_saw_to_the_old_one() -> None:
    box = replace(camera_car(45.0, score=0.4), vision_track=7, id=2)
    state = ExistenceState({1: Existence(0.4, 4.0)}, {7: 1})
    assert existence_after(state, box) < 0.5
    assert existence_after(state, replace(box, id=1)) > 0.9


@pytest.mark.parametrize(("ranges", "kept"), [(21, True), (1, False)], ids=["followed on", "begun anew"])
def test_that_a_place_was_taken_says_nothing_of_another_place(ranges: int, kept: bool) -> None:
    car = replace(camera_car(45.0, score=0.4), camera_ranges=ranges)
    known = ExistenceState({1: Existence(0.4, 4.0, last_place(replace(car, camera_ranges=20)))})
    assert (existence_after(known, car) > 0.9) == kept


@pytest.mark.parametrize(("lidar_m", "kept"), [(50.0, True), (70.0, False)], ids=["about there", "far from there"])
def test_what_the_lidar_saw_ends_where_the_camera_alone_places_it_elsewhere(lidar_m: float, kept: bool) -> None:
    car = replace(camera_car(45.0, score=0.4), distance_sigma_m=3.0)
    seen = replace(car, source="VL", seen_by="VL", distance_m=lidar_m, distance_sigma_m=0.2)
    known = ExistenceState({1: Existence(0.4, 4.0, last_place(seen))})
    assert (existence_after(known, car) > 0.9) == kept
    assert existence_after(known, car, params=ExistenceParams(forget_at_takeover=False)) > 0.9


def test_an_empty_place_is_forgotten_where_the_lidar_cannot_tell_any_more() -> None:
    car = camera_car(45.0, score=0.7)
    assert existence_after(seen_through(), car, 5) < 0.5
    assert existence_after(seen_through(), car, 30) > 0.85
    assert existence_after(seen_through(), replace(car, returns=2), 8) > 0.85, "returns of its own say the contrary"


EMPTY = RawBoxes("net", np.zeros((0, 4), np.float32), np.zeros(0, np.float32), ())
IMAGE = Frame(0, "0", 0, image=CameraImage(None, np.zeros((720, 1280, 3), np.uint8)), raw_boxes=EMPTY)


def unseen(followed: int, images: int, frame: Frame = IMAGE, *others: FusedObject, u: float = 600.0) -> float:
    """Existence of a camera-only car 50 m away, seen in this many images with a score of 0.7, then missed."""
    car = replace(camera_car(50.0, score=0.7), bbox=(u, 350.0, u + 30.0, 375.0))
    state = ExistenceState()
    for k in range(followed):
        state, _ = weigh(state, (car,), Rays(NOTHING), IMAGE, moment(None, 0.1 if k else None), PARAMS)
    for _ in range(images):
        carried = replace(car, seen_by="")
        state, (found, *_) = weigh(state, (carried, *others), Rays(NOTHING), frame, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    return found.existence


def test_a_burst_of_false_boxes_is_over_when_it_ends_and_a_car_that_is_missed_is_not() -> None:
    assert unseen(3, 4) < CipvParams().stay_probability
    assert unseen(40, 4) > 0.6


@pytest.mark.parametrize(
    ("case", "frame", "others", "u"),
    [
        ("nobody looked", replace(IMAGE, raw_boxes=None), (), 600.0),
        ("it has left the image", IMAGE, (), 1270.0),
        ("a nearer car hides it", IMAGE, (replace(fused(2, 10.0), bbox=(500.0, 300.0, 700.0, 450.0)),), 600.0),
    ],
)
def test_what_could_not_be_seen_is_not_missed(
    case: str, frame: Frame, others: tuple[FusedObject, ...], u: float
) -> None:
    assert unseen(3, 6, frame, *others, u=u) > 0.85, case


def test_where_the_far_view_sits_out_a_frame_nothing_is_missed() -> None:
    far = replace(IMAGE, raw_boxes=replace(EMPTY, far=(400, 200, 816, 616)))
    state = weigh(ExistenceState(), (), Rays(NOTHING), far, moment(), PARAMS)[0]
    assert state.looks_far
    car = replace(camera_car(50.0, score=0.7), bbox=(600.0, 350.0, 630.0, 375.0))
    state, _ = weigh(state, (car,), Rays(NOTHING), far, moment(None, 0.1), PARAMS)
    known = state.known[1].score
    state, _ = weigh(state, (replace(car, seen_by=""),), Rays(NOTHING), IMAGE, moment(None, 0.1), PARAMS)
    assert state.known[1].score == known
    state, _ = weigh(state, (replace(car, seen_by=""),), Rays(NOTHING), far, moment(None, 0.1), PARAMS)
    assert state.known[1].score < known  # type: ignore[operator]


@pytest.mark.parametrize(
    ("case", "closing_mps", "exists"),
    [("it keeps its distance", 0.0, True), ("it is slower by 5 m/s", 5.0, True), ("it stands", 20.0, False)],
)
def test_a_weak_box_that_goes_along_is_a_vehicle(case: str, closing_mps: float, exists: bool) -> None:
    """At 72 km/h, with scores at which half of all boxes are false."""
    state = ExistenceState()
    for k in range(16):
        car = replace(camera_car(60.0 - 0.1 * closing_mps * k, score=0.45), camera_ranges=k + 1)
        now = moment(EgoState(0, 20.0), 0.1 if k else None)
        state, (found,) = weigh(state, (car,), Rays(NOTHING), FRAME, now, PARAMS)
    assert found.existence is not None
    assert (found.existence > CipvParams().become_existence) == exists, case
    again = replace(car, camera_ranges=1)
    now = moment(EgoState(0, 20.0), 0.1)
    begun = weigh(state, (again,), Rays(NOTHING), FRAME, now, PARAMS)[1][0].existence
    assert begun == pytest.approx(0.5), "a place begun anew may be another thing"


@pytest.mark.parametrize(
    ("case", "first_m", "closing_mps", "along"),
    [
        ("a box at 160 m, then a car that keeps its distance", 160.0, 0.0, True),
        ("a box at 160 m, then a static object", 160.0, 20.0, False),
        ("oncoming at our speed", 60.0, 40.0, False),
    ],
)
def test_a_wrong_first_distance_does_not_hide_that_a_car_goes_along(
    case: str, first_m: float, closing_mps: float, along: bool
) -> None:
    """At 72 km/h, for 2.4 s; the first distance is that of a false box."""
    state = ExistenceState()
    for k in range(24):
        car = replace(camera_car(first_m if k == 0 else 100.0 - 0.1 * closing_mps * k, score=0.45), camera_ranges=k + 1)
        now = moment(EgoState(0, 20.0), 0.1 if k else None)
        state, _ = weigh(state, (car,), Rays(NOTHING), FRAME, now, PARAMS)
    assert state.known[1].goes_along is along, case


def test_what_is_only_predicted_does_not_go_along() -> None:
    """A weak box on a static object, seen for 0.4 s; then the car drives 36 m without measuring it again."""
    state = ExistenceState()
    for k in range(18):
        car = replace(camera_car(60.0 - 2.0 * min(k, 4), score=0.45), seen_by="V" if k < 5 else "", measured=k < 5)
        now = moment(EgoState(0, 20.0), 0.1 if k else None)
        state, _ = weigh(state, (car,), Rays(NOTHING), FRAME, now, PARAMS)
    assert not state.known[1].goes_along


def test_switched_off_nothing_is_said() -> None:
    found = after(camera_car(), Rays(returns(40.0)), params=ExistenceParams(enabled=False))
    assert (found.existence, gate(found)) == (None, None)
