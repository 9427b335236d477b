"""Learning how tall one vehicle is, alone, in the tracker, and over the whole pipeline with the LiDAR cut off."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.params import VisionTrackingParams
from pipeline.types import Detection, RoadSight, VisionMeasurement
from pipeline.vision.tracking import VisionTrackerState, forget_heights, learn_heights, track
from pipeline.vision.vehicle_height import (
    FLOOR_SHARE,
    HEIGHT_RATIOS,
    NEAREST_M,
    NO_OTHER,
    BoxShape,
    Height,
    OtherClass,
    RoadContact,
    hinted,
    learn,
    other_class,
)

SPREAD, NOISE = 0.2, 0.03
PARAMS = VisionTrackingParams()


def test_a_tall_van_is_learned_and_its_sigma_shrinks_to_the_floor() -> None:
    height = Height()
    for _ in range(10):
        height = learn(height, 25.0, NOISE, SPREAD, 30.0, 0.2)
    assert height.factor == pytest.approx(1.2, rel=0.02)
    assert height.sigma == FLOOR_SHARE
    assert height.share(SPREAD) == FLOOR_SHARE
    assert Height().share(SPREAD) == SPREAD


@pytest.mark.parametrize(
    ("case", "law_m", "range_m"),
    [
        ("another vehicle's range", 20.0, 45.0),
        ("too near to tell", 9.0, NEAREST_M - 0.1),
        ("no car is half as tall", 40.0, 20.0),
    ],
)
def test_what_teaches_nothing(case: str, law_m: float, range_m: float) -> None:
    taught = learn(Height(), law_m, NOISE, SPREAD, range_m, 0.2)
    assert taught._replace(contradictions=0) == Height(), case


def test_a_range_that_insists_is_right_and_the_class_is_wrong() -> None:
    """A lorry that is called a car, ranged at 55 m where its box means 15 m; while the LiDAR misses it for a moment,
    the camera keeps it there."""
    state, placed = VisionTrackerState(), []
    for k in range(12):
        state, (one,) = track(state, (seen(15.0),), 0.1 if k else None, PARAMS, 20.0)
        placed.append(one.distance_m or 0.0)
        if k < 9:
            state = learn_heights(state, {one.id: (55.0, 0.2)}, PARAMS)
    assert placed[4] == pytest.approx(15.0, rel=0.1), "not from a few: they may be another vehicle's"
    assert placed[10:] == pytest.approx([55.0, 55.0], rel=0.1)


def test_the_height_of_a_part_of_a_car_is_forgotten_when_the_whole_car_is_boxed() -> None:
    """A car at 40 m, whose first box leaves out its roof, in which a LiDAR return ranges it."""
    x1, y1, x2, y2 = seen(40.0).detection.bbox
    part = Detection((x1, y1 + (y2 - y1) / 3, x2, y2), "car", 0.8)
    ranged = replace(seen(60.0), detection=part, ranged_m=40.0, ranged_sigma_m=0.3, returns=2, noise_share=0.1)
    state, _ = track(VisionTrackerState(), (ranged,), None, PARAMS, 20.0)
    for _ in range(6):
        state, (one,) = track(state, (seen(40.0),), 0.1, PARAMS, 20.0)
    assert one.distance_m == pytest.approx(40.0, rel=0.1)


def test_no_number_of_ranges_makes_a_car_lower_than_cars_are() -> None:
    """The box of a car at 45 m, paired with what the LiDAR sees at 16 m: a post, or another car in front."""
    height = Height()
    for _ in range(20):
        height = learn(height, 45.0, NOISE, SPREAD, 16.0, 0.2)
    assert height == Height()
    lorry = Height()
    for _ in range(20):
        lorry = learn(lorry, 45.0, NOISE, SPREAD, 25.0, 0.2, class_factor=1.7)
    assert lorry.factor == pytest.approx(25.0 / 45.0, rel=0.02), "what is called a lorry may be a car"


def seen(law_m: float) -> VisionMeasurement:
    tall = 1400.0 / law_m
    box = (600.0 - tall / 2, 300.0 - tall / 2, 600.0 + tall / 2, 300.0 + tall / 2)
    noise = math.hypot(2.0 / tall, NOISE)
    sigma = law_m * math.hypot(2.0 / tall, SPREAD)
    return VisionMeasurement(Detection(box, "car", 0.8), law_m, sigma, (law_m, 0.0), noise, SPREAD)


@pytest.mark.parametrize("learns", [True, False])
def test_a_lead_that_leaves_the_lidars_reach_keeps_its_distance(learns: bool) -> None:
    """It is 20 % taller than a car, so the law gives 20 % less; the LiDAR sees it for a second, then it moves away."""
    params = PARAMS.model_copy(update={"learn_height": learns})
    state = VisionTrackerState()
    closing = []
    for k in range(40):
        true_m = 25.0 + 0.8 * k
        state, (one,) = track(state, (seen(true_m / 1.2),), 0.1 if k else None, params, 20.0)
        if k < 10:
            state = learn_heights(state, {one.id: (true_m, 0.2)}, params)
            assert one.velocity_mps is None or k < 3 or abs(one.velocity_mps[0] - 8.0) < 6.0, "learning is no motion"
        closing.append(one.velocity_mps[0] if one.velocity_mps else np.nan)
    assert one.distance_m is not None
    assert one.sigma_m is not None
    off = abs(one.distance_m - true_m) / true_m
    assert (off < 0.03) == learns
    assert (one.sigma_m / one.distance_m < 0.1) == learns
    assert off < 2 * one.sigma_m / one.distance_m


FACTORS = {"car": 1.0, "truck": 2.4}


def called(label: str, range_m: float) -> VisionMeasurement:
    """A truck at this range, with the class that the detector returns in this image."""
    one = seen(range_m / FACTORS["truck"] * FACTORS[label])
    box = seen(range_m / FACTORS["truck"]).detection.bbox
    return replace(one, detection=Detection(box, label, 0.8), class_factors=FACTORS)


def test_a_truck_that_is_called_a_car_for_a_while_stays_where_it_is() -> None:
    """With a car's law, its box means 25 m instead of 60 m."""
    state = VisionTrackerState()
    for k in range(20):
        measured = called("car" if 8 <= k < 13 else "truck", 60.0)
        state, (one,) = track(state, (measured,), 0.1 if k else None, PARAMS, 20.0)
        assert one.label == "truck"
        assert one.distance_m == pytest.approx(60.0, rel=0.05)


def test_what_was_learned_is_kept_when_the_class_turns_out_to_be_another() -> None:
    """Its height in metres is known; only the class height that it is a multiple of changes."""
    state, labels = VisionTrackerState(), []
    for k in range(30):
        measured = called("car" if k < 8 else "truck", 60.0)
        state, (one,) = track(state, (measured,), 0.1 if k else None, PARAMS, 20.0)
        if k < 6:
            state = learn_heights(state, {one.id: (25.0 * 1.1, 0.2)}, PARAMS)
        if k >= 6:
            assert one.distance_m == pytest.approx(25.0 * 1.1, rel=0.05)
        labels.append(one.label)
    assert labels[0] == "car"
    assert labels[-1] == "truck"


@pytest.mark.parametrize(("other_m", "is_forgotten"), [(16.0, True), (9.0, False)])
def test_what_was_learned_from_another_vehicles_ranges_is_forgotten(other_m: float, is_forgotten: bool) -> None:
    """A car at 22 m, ranged at 16 m by the cluster of a nearer one, which now goes on with another box. other_m: where
    that box puts its own vehicle. If the cluster fits it less than the first, it was not the first that was wrong."""
    state = VisionTrackerState()
    for k in range(6):
        state, (one,) = track(state, (seen(22.0),), 0.1 if k else None, PARAMS, 0.0)
        state = learn_heights(state, {one.id: (16.0, 0.2)}, PARAMS)
    x1, y1, x2, y2 = seen(other_m).detection.bbox
    beside = replace(seen(other_m), detection=Detection((x1 + 300, y1, x2 + 300, y2), "car", 0.8))
    state, tracks = track(state, (seen(22.0), beside), 0.1, PARAMS, 0.0)
    first, second = tracks
    assert first.distance_m == pytest.approx(16.0, rel=0.05)
    state, (after, _) = forget_heights(state, tracks, {first.id: (second.id, 16.0)})
    assert after.distance_m == pytest.approx(22.0 if is_forgotten else 16.0, rel=0.05)
    assert after.height_from == ("class" if is_forgotten else "range")
    assert after.sigma_m is not None
    assert (after.sigma_m > 0.15 * 22.0) == is_forgotten
    state, (later, _) = track(state, (seen(22.0), beside), 0.1, PARAMS, 0.0)
    assert later.distance_m == pytest.approx(22.0 if is_forgotten else 16.0, rel=0.05)
    assert later.velocity_mps is not None
    assert abs(later.velocity_mps[0]) < 3.0, "the correction is no motion"


def test_a_range_of_no_track_changes_nothing() -> None:
    state, _ = track(VisionTrackerState(), (seen(20.0),), None, PARAMS)
    assert learn_heights(state, {99: (25.0, 0.2)}, PARAMS) == state


def test_returns_of_a_far_vehicle_place_it_without_seeming_motion() -> None:
    """For a second, it is ranged by its box, 15 % too near; then by one return in every other frame."""
    state = VisionTrackerState()
    for k in range(20):
        measured = seen(60.0 / 1.15)
        if k >= 10 and k % 2 == 0:
            measured = replace(measured, ranged_m=60.0, ranged_sigma_m=0.5, returns=1)
        state, (one,) = track(state, (measured,), 0.1 if k else None, PARAMS, 20.0)
        assert (one.returns == 1) == (measured.ranged_m is not None)
    assert one.distance_m == pytest.approx(60.0, abs=1.0)
    assert one.velocity_mps is not None
    assert abs(one.velocity_mps[0]) < 3.0
    assert one.ranges == 20, "its place was not begun anew"


def test_a_place_that_rests_on_ranges_stays_when_a_height_is_unlearned() -> None:
    """The first box, with a range, contained only the upper part of the car. The next one is complete: the car has not
    moved."""
    state, speeds = VisionTrackerState(), []
    for k in range(8):
        measured = replace(seen(50.0 if k < 2 else 40.0), ranged_m=40.0, ranged_sigma_m=0.5, returns=2)
        state, (one,) = track(state, (measured,), 0.1 if k else None, PARAMS, 0.0)
        speeds.append(one.velocity_mps[0] if one.velocity_mps is not None else 0.0)
    assert max(abs(speed) for speed in speeds) < 4.0
    assert one.distance_m == pytest.approx(40.0, abs=0.5)


@pytest.mark.parametrize(
    ("case", "height_m", "width_m", "taller"),
    [
        ("a usual car", 1.5, 1.75, 0.0),
        ("a car that is turned", 1.5, 3.0, 0.0),
        ("a van", 2.0, 1.9, 0.08),
        ("half of a car", 1.5, 0.9, 0.0),
    ],
)
def test_only_a_box_that_is_tall_for_its_width_is_of_a_taller_vehicle(
    case: str, height_m: float, width_m: float, taller: float
) -> None:
    shape = BoxShape().seen(math.log(height_m / width_m))
    assert shape.height == pytest.approx(taller, abs=0.01), case
    assert shape.seen(None) == shape, case


def test_a_shape_averages_single_boxes_and_follows_a_turn() -> None:
    shape = BoxShape()
    for k in range(20):
        shape = shape.seen(0.1 + (0.2 if k % 2 else -0.2))
    assert shape.height == pytest.approx(0.5 * (0.1 - math.log(1.55 / 1.73)), abs=0.02)
    for _ in range(30):
        shape = shape.seen(-0.5)
    assert shape.height == 0.0
    assert BoxShape().height == 0.0


@pytest.mark.parametrize("uses", [True, False])
def test_a_van_that_only_the_camera_sees_is_placed_by_the_shape_of_its_box(uses: bool) -> None:
    """It is 2.0 m tall and 1.9 m wide; a car's law places it 25 % too near. Its speed comes from its box, and the
    correction by its shape does not count as motion."""
    params, state, true_m = PARAMS.model_copy(update={"use_aspect": uses}), VisionTrackerState(), 60.0
    for k in range(20):
        measured = replace(seen(true_m * 1.55 / 2.0), aspect=math.log(2.0 / 1.9) if k >= 5 else None)
        state, (one,) = track(state, (measured,), 0.1 if k else None, params, 0.0)
    assert one.distance_m == pytest.approx(true_m * 1.55 / 2.0 * (math.exp(0.08) if uses else 1.0), rel=0.01)
    assert one.velocity_mps is not None
    assert abs(one.velocity_mps[0]) < 0.5


def test_what_the_lidar_taught_counts_more_than_the_shape() -> None:
    state = VisionTrackerState()
    for k in range(20):
        measured = replace(seen(25.0), aspect=0.1)
        state, (one,) = track(state, (measured,), 0.1 if k else None, PARAMS, 0.0)
        if k < 10:
            state = learn_heights(state, {one.id: (26.0, 0.2)}, PARAMS)
    assert one.distance_m == pytest.approx(26.0, rel=0.02)


EYE_M, LAW_M = 1.2, 40.0


def sight(log_ratio: float, sigma: float = 0.07, noise: float = 0.0, law_m: float = LAW_M) -> RoadSight:
    """A box whose lower edge meets a flat road where ln(height ratio) is ``log_ratio``, give or take ``sigma``."""
    slope = EYE_M / law_m * math.exp(-log_ratio)
    above = EYE_M / law_m * np.exp(-HEIGHT_RATIOS) - slope
    return RoadSight(above, np.full(len(HEIGHT_RATIOS), sigma * slope), noise * slope, 1.5 / law_m)


def contact(log_ratio: float, sigma: float) -> RoadContact:
    return RoadContact().seen(sight(log_ratio, sigma))


MAY_BE_A_TRUCK = OtherClass(math.log(2.0), 0.03)


@pytest.mark.parametrize(
    ("case", "seen_on_road", "other", "factor", "sigma"),
    [
        ("no contact", RoadContact(), NO_OTHER, 1.0, None),
        ("a van", contact(math.log(1.4), 0.07), NO_OTHER, 1.36, 0.08),
        ("a road that is hardly known", contact(math.log(1.4), 0.2), NO_OTHER, 1.21, 0.16),
        ("as the class says", contact(0.0, 0.07), NO_OTHER, 1.0, 0.07),
        ("a truck that is called a car", contact(math.log(2.1), 0.1), MAY_BE_A_TRUCK, 2.03, 0.25),
        ("half as tall as a car", contact(math.log(0.5), 0.12), NO_OTHER, 0.82, 0.24),
        ("something hides its tyres", contact(math.log(3.2), 0.07), NO_OTHER, 1.0, 0.2),
    ],
)
def test_how_boxes_fit_the_road_tells_the_height_as_well_as_the_road_is_known(
    case: str, seen_on_road: RoadContact, other: OtherClass, factor: float, sigma: float | None
) -> None:
    height = hinted(BoxShape(), seen_on_road, SPREAD, other)
    assert height.factor == pytest.approx(factor, rel=0.05), case
    assert height.sigma == (None if sigma is None else pytest.approx(sigma, rel=0.2)), case
    assert not height.is_ranged


def test_a_line_of_sight_above_the_road_leaves_a_car_and_a_truck_possible() -> None:
    """The road is known at the distance of a car, and hardly at that of a truck."""
    found = sight(math.log(2.2), 0.07)
    found = found._replace(lasting=found.lasting * np.where(HEIGHT_RATIOS < 0.4, 3.0, 8.0))
    height = hinted(BoxShape(), RoadContact().seen(found), SPREAD, MAY_BE_A_TRUCK)
    assert height.sigma is not None
    assert height.mean - 2.0 * height.sigma < 0.0 < math.log(2.0) < height.mean + 2.0 * height.sigma
    assert height.sigma > SPREAD


def test_what_is_called_a_truck_may_be_a_car() -> None:
    as_car, other = contact(math.log(1.0 / 1.6), 0.08), other_class("truck", {"car": 1.0, "truck": 1.6})
    assert other.ratio == pytest.approx(math.log(1.0 / 1.6))
    assert hinted(BoxShape(), as_car, SPREAD, other).factor == pytest.approx(1.0 / 1.6, rel=0.08)
    assert hinted(BoxShape(), as_car, SPREAD).factor > 1.05 / 1.6


def test_only_what_the_detector_confuses_may_be_another_class() -> None:
    factors = {"car": 1.0, "truck": 1.6, "bus": 2.0, "motorcycle": 0.8}
    assert other_class("car", factors).ratio == pytest.approx(math.log(2.0))
    assert other_class("bus", factors).ratio == pytest.approx(-math.log(2.0))
    assert other_class("motorcycle", factors) == NO_OTHER
    assert other_class("car", {"car": 1.0}) == NO_OTHER


def test_a_contact_averages_single_boxes() -> None:
    seen_on_road, sigmas = RoadContact(), []
    for k in range(20):
        seen_on_road = seen_on_road.seen(sight(0.1 + (0.1 if k % 2 else -0.1), 0.08, 0.1))
        sigmas.append(hinted(BoxShape(), seen_on_road, SPREAD).sigma or 0.0)
    assert hinted(BoxShape(), seen_on_road, SPREAD).mean == pytest.approx(0.09, abs=0.02)
    assert sigmas[9] == pytest.approx(sigmas[19], rel=1e-3)
    assert sigmas[9] < 0.85 * sigmas[0]
    assert sigmas[19] > 0.07, "the road stays unknown"


def test_a_contact_is_the_same_place_for_another_class() -> None:
    moved = contact(0.3, 0.07).as_ratio_to(-0.2)
    assert hinted(BoxShape(), moved, 3.0).mean == pytest.approx(0.1, abs=0.01)


def test_a_range_overrules_a_contact() -> None:
    """Even a contact that is far off and has a small sigma."""
    height = hinted(BoxShape(), contact(0.4, 0.03), SPREAD)
    for _ in range(5):
        height = learn(height, 25.0, NOISE, SPREAD, 25.0, 0.2)
    assert height.is_ranged
    assert height.factor == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("from_k", [0, 8])
def test_a_van_that_only_the_camera_sees_stands_where_it_meets_the_road(from_k: int) -> None:
    """It keeps its distance; the correction by the road is not motion. from_k: when its lower edge becomes visible."""
    state, true_m = VisionTrackerState(), 50.0
    for k in range(25):
        law_m = true_m / 1.4
        on_road = sight(math.log(1.4), 0.08, law_m=law_m) if k >= from_k else None
        measured = replace(seen(law_m), road=on_road, class_factors={"car": 1.0})
        state, (one,) = track(state, (measured,), 0.1 if k else None, PARAMS, 0.0)
    assert one.distance_m == pytest.approx(true_m * 1.4**-0.14, rel=0.02)
    assert one.sigma_m is not None
    assert 0.1 < one.sigma_m / one.distance_m < 0.14
    assert one.velocity_mps is not None
    assert abs(one.velocity_mps[0]) < 0.5


def test_another_class_leaves_a_vehicle_where_it_meets_the_road() -> None:
    """A truck's law gives twice a car's distance; its boxes are classified as cars, then as trucks."""
    state, factors = VisionTrackerState(), {"car": 1.0, "truck": 1.5}
    for k in range(30):
        label = "car" if k < 10 else "truck"
        plain = seen(40.0 * factors[label] / 1.25)
        measured = replace(
            plain, detection=replace(plain.detection, label=label), class_factors=factors,
            road=sight(math.log(1.25 / factors[label]), law_m=40.0 * factors[label] / 1.25),
        )  # fmt: skip
        state, (one,) = track(state, (measured,), 0.1 if k else None, PARAMS, 0.0)
        assert one.distance_m == pytest.approx(40.0, rel=0.1)
    assert one.label == "truck"
