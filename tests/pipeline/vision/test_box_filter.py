"""The filter of a box's centre: what it expects of turns, parts of vehicles and new boxes."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.params import VisionTrackingParams
from pipeline.vision import box_filter

PARAMS = VisionTrackingParams()
CAR = (600.0, 300.0, 640.0, 330.0)


def test_a_new_box_moves_with_the_image() -> None:
    begun = box_filter.start(CAR, 50.0, PARAMS)
    (later,) = box_filter.predict([begun], [CAR], 0.5, None, PARAMS)
    assert later.mean[:2].tolist() == pytest.approx([620.0 + 25.0, 315.0])


def test_turning_faster_moves_every_box_by_as_much() -> None:
    other = (100.0, 300.0, 200.0, 350.0)
    begun = [box_filter.start(box, 0.0, PARAMS) for box in (CAR, other)]
    steady = box_filter.predict(begun, [CAR, other], 0.1, 0.0, PARAMS)
    turning = box_filter.predict(begun, [CAR, other], 0.1, 30.0, PARAMS)
    for before, after in zip(steady, turning, strict=True):
        assert (after.mean - before.mean).tolist() == pytest.approx([1.5, 0.0, 30.0, 0.0])


def test_a_measured_turn_leaves_less_uncertainty_than_an_unknown_one() -> None:
    begun = box_filter.start(CAR, 0.0, PARAMS)
    (unknown,) = box_filter.predict([begun], [CAR], 0.5, None, PARAMS)
    (measured,) = box_filter.predict([begun], [CAR], 0.5, 0.0, PARAMS)
    assert measured.cov[0, 0] < unknown.cov[0, 0]


def test_a_box_on_a_part_of_the_vehicle_hardly_moves_the_centre() -> None:
    begun = box_filter.start(CAR, 0.0, PARAMS)
    left_half = (600.0, 300.0, 620.0, 330.0)
    beside = (590.0, 300.0, 630.0, 330.0)  # its centre is as far off, its size is right
    part, whole = (box_filter.update([begun], [box], [CAR], PARAMS)[0].mean[0] for box in (left_half, beside))
    assert whole < part < 620.0
    assert 620.0 - part < 0.5 * (620.0 - whole)


def test_wide_boxes_have_wider_noise() -> None:
    narrow, wide = ((0.0, 0.0, w, 50.0) for w in (20.0, 200.0))
    assert box_filter.centre_variance(wide, PARAMS) > 2 * box_filter.centre_variance(narrow, PARAMS)


def test_a_box_keeps_its_size_around_another_centre() -> None:
    assert box_filter.around(np.array([10.0, 20.0]), (0.0, 0.0, 8.0, 4.0), 1.5) == (4.0, 17.0, 16.0, 23.0)
