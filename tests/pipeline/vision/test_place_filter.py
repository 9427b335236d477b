"""A boxed object's range, which errs by shares of itself, and a filter that must neither run away nor be muted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common import kalman
from pipeline.params import VisionTrackingParams
from pipeline.types import Detection, VisionMeasurement, VisionTrack
from pipeline.vision import place_filter
from pipeline.vision.place_filter import PlaceMeasurement
from pipeline.vision.tracking import VisionTrackerState, track

PARAMS = VisionTrackingParams()


def sighting(range_m: float, bearing_rad: float = 0.0, share: float = 0.05) -> PlaceMeasurement:
    return PlaceMeasurement(range_m, bearing_rad, share, 0.005)


def seen(range_m: float, u: float = 600.0, height_px: float | None = None) -> VisionMeasurement:
    """A car straight ahead, 1.5 m tall, seen with a focal length of 721 px."""
    tall = height_px if height_px is not None else 721.0 * 1.5 / range_m
    box = (u - 0.6 * tall, 180.0 - tall / 2, u + 0.6 * tall, 180.0 + tall / 2)
    side_m = (600.0 - u) / 721.0 * range_m
    return VisionMeasurement(Detection(box, "car", 0.8), range_m, 0.1 * range_m, (range_m, side_m), 2.0 / tall)


def follow(images: list[list[VisionMeasurement]], ego_mps: float | None = 10.0) -> list[tuple[VisionTrack, ...]]:
    """The tracks of every image, at 10 Hz."""
    state, shown = VisionTrackerState(), []
    for k, boxes in enumerate(images):
        state, tracks = track(state, tuple(boxes), 0.1 if k else None, PARAMS, ego_mps)
        shown.append(tracks)
    return shown


@given(st.floats(5.0, 100.0), st.floats(-0.6, 0.6), st.floats(0.02, 0.3))
def test_a_sighting_where_it_is_expected_is_no_surprise(range_m: float, bearing: float, share: float) -> None:
    begun = place_filter.start(sighting(range_m, bearing, share), 0.0, 8.0)
    assert place_filter.update(begun, sighting(range_m, bearing, share))[1] == pytest.approx(0.0, abs=1e-9)
    assert place_filter.radial_sigmas(begun)[0] == pytest.approx(share * range_m, rel=1e-6)


@given(st.floats(5.0, 100.0), st.floats(0.05, 0.4))
def test_half_as_far_and_twice_as_far_are_equally_surprising(range_m: float, share: float) -> None:
    begun = place_filter.start(sighting(range_m, share=share), 0.0, 8.0)
    nearer, farther = (place_filter.update(begun, sighting(range_m * by, share=share))[1] for by in (0.5, 2.0))
    assert nearer == pytest.approx(farther, rel=1e-6)


def test_a_growing_box_is_a_closing_speed() -> None:
    state = place_filter.start(sighting(60.0), 0.0, 8.0)
    for k in range(1, 31):
        state, _ = place_filter.update(kalman.predict(state, 0.1, 3.0), sighting(60.0 - 1.0 * k))
    assert state.mean[2] == pytest.approx(-10.0, abs=0.5)
    assert math.hypot(*place_filter.position(state)) == pytest.approx(30.0, rel=0.02)


def test_the_error_of_a_closing_speed_is_as_large_as_it_says() -> None:
    """A parked car approached at 10 m/s, whose box has a noise of 2 px and is always 10 % too small."""
    rng, off = np.random.default_rng(3), []
    for _ in range(40):
        images = []
        for k in range(15):
            range_m = 45.0 - k
            tall = 721.0 * 1.5 / (1.1 * range_m) + rng.normal(0.0, 2.0)
            images.append([seen(721.0 * 1.5 / tall, height_px=tall)])
        shown = [tracks[0] for tracks in follow(images)]
        first, last = shown[2], shown[-1]
        assert first.speed_sigma_mps is not None
        assert last.speed_sigma_mps is not None
        assert last.velocity_mps is not None
        assert last.speed_sigma_mps < 0.5 * first.speed_sigma_mps
        off.append((last.velocity_mps[0] + 10.0) / last.speed_sigma_mps)
    assert 0.4 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_a_small_box_does_not_become_its_neighbour() -> None:
    """Parked cars 55 m away, 30 px apart: if one is missed in three images, its id does not pass to the next."""
    left, right = (lambda k: seen(55.0 - k, 560.0)), (lambda k: seen(55.0 - k, 590.0))
    shown = follow([[left(k)] for k in range(5)] + [[right(k)] for k in range(5, 8)])
    (first,) = shown[4]
    last = {each.id: each for each in shown[-1]}
    assert first.id not in last or last[first.id].carried
    assert any(each.id != first.id and not each.carried for each in shown[-1])


def test_one_wrong_height_is_refused_and_the_place_kept() -> None:
    """In one image, the network returns the upper half of the car: by its height, twice as far."""
    shown = follow([[seen(24.0)]] * 8 + [[seen(42.0, height_px=29.0)]] + [[seen(24.0)]], 0.0)
    assert [each.id for each in shown[8]] == [shown[0][0].id], "it keeps its number"
    assert not shown[8][0].measured
    assert shown[8][0].distance_m == pytest.approx(24.0, rel=0.05)
    assert shown[9][0].distance_m == pytest.approx(24.0, rel=0.05)


def test_a_place_that_is_contradicted_for_long_begins_anew() -> None:
    """The filter was wrong, not the images: it must restart, and its speed must be measured again."""
    shown = follow([[seen(12.0, height_px=60.0)]] * 8 + [[seen(45.0, height_px=45.0)]] * 4, 0.0)
    assert shown[-1][0].distance_m == pytest.approx(45.0, rel=0.05)
    assert shown[-1][0].ranges < 4
    velocity = shown[-1][0].velocity_mps
    assert velocity is None or abs(velocity[0]) < 15.0


def test_nothing_is_faster_than_cars_are() -> None:
    """Boxes shrink as if the object moved away at 120 m/s: the position is reset instead."""
    shown = follow([[seen(20.0 + 12.0 * k, height_px=50.0)] for k in range(10)])
    speeds = [each.velocity_mps[0] for tracks in shown for each in tracks if each.velocity_mps is not None]
    assert all(speed + 10.0 <= 70.0 for speed in speeds)


def test_the_covariance_stays_positive() -> None:
    state = place_filter.start(sighting(50.0), -5.0, 8.0)
    rng = np.random.default_rng(1)
    for _ in range(50):
        state, _ = place_filter.update(
            kalman.predict(state, 0.1, 3.0), sighting(40.0 + rng.normal(), rng.normal() * 0.01)
        )
        assert np.linalg.eigvalsh(state.cov).min() > 0.0


@pytest.mark.parametrize(("expected_m", "found_m"), [(77.0, 42.7), (42.7, 77.0), (30.0, 12.0)])
def test_a_precise_sighting_far_from_a_vague_place_is_where_the_place_goes(expected_m: float, found_m: float) -> None:
    """A single linear step in the logarithm overshoots: from 77 m, a sighting at 42.7 m would give 32 m."""
    vague = place_filter.start(sighting(expected_m, share=0.6), 0.0, 8.0)
    x, y = place_filter.position(place_filter.update(vague, sighting(found_m, share=0.012))[0])
    assert math.hypot(x, y) == pytest.approx(found_m, rel=0.01)


def test_half_a_vehicle_drawn_for_a_moment_does_not_send_it_sideways() -> None:
    """Only the right half of the box, twice: its centre jumps by a quarter of a car, 0.45 m. That is not a lane
    change."""
    whole = [seen(40.0, u=600.0) for _ in range(15)]
    x1, y1, x2, y2 = whole[0].detection.bbox
    middle = (x1 + 3 * x2) / 4
    half = VisionMeasurement(
        Detection(((x1 + x2) / 2, y1, x2, y2), "car", 0.8), 40.0, 4.0, (40.0, (600.0 - middle) / 721.0 * 40.0), 0.07
    )
    moved = VisionMeasurement(
        Detection((x1 + middle - 600.0, y1, x2 + middle - 600.0, y2), "car", 0.8), 40.0, 4.0, half.position, 0.07
    )

    def sideways_mps(box: VisionMeasurement) -> float:
        (last,) = follow([[each] for each in (*whole, box, box)])[-1]
        assert last.velocity_mps is not None
        return abs(last.velocity_mps[1])

    assert sideways_mps(half) < 0.5 * sideways_mps(moved), "a whole box that has moved is believed"
