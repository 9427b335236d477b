"""Edges of boxes and clusters: outliers, and which box belongs to which cluster."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.alignment.projection import Angular, resolve
from pipeline.calibration.alignment.models import FitModel
from pipeline.calibration.alignment.pairs import PairTable, angular_extents, coarse_scores
from pipeline.params import AlignmentParams
from tests.pipeline.calibration.alignment.made_drive import CAMERA, SIZE, drive

ALIGNED = resolve(AlignmentParams(), CAMERA)
assert ALIGNED is not None


def table(**how: int) -> PairTable:
    assert ALIGNED is not None
    return PairTable.of(drive(ALIGNED, **{"frames": 6, "cars": 3, "walls": 2} | how))


def test_a_car_lies_on_its_box_and_no_other():
    found = table()
    off = found.residuals(ALIGNED)
    rows = found.matched(off, 2.5)
    cars = found.box[rows] % 5 < 3
    assert (found.box[rows] == found.cluster[rows])[cars].all()
    assert cars.sum() >= 0.8 * 18
    assert np.abs(off[rows]).mean() < 1.0


def test_a_roof_between_two_rings_is_off_by_nothing_and_beyond_them_by_the_rest():
    found = table(frames=1, cars=1, walls=0)
    low, high = found.extents(ALIGNED)[0, 2:4]
    assert high < low
    for y1, expected_px in ((low - 0.1, 0.0), (high + 0.1, 0.0), (low + 20.0, -20.0), (high - 20.0, 20.0)):
        boxed = replace(found, boxes=np.array([[*found.boxes[0, :1], y1, *found.boxes[0, 2:]]]))
        _, down = boxed.deviations(1.0, 0.0)
        assert boxed.residuals(ALIGNED)[0, 1] * down[0] == pytest.approx(expected_px, abs=1e-6)


def test_an_edge_of_the_image_says_nothing():
    found = table(frames=1, cars=1, walls=0)
    cut = replace(found, whole=np.array([[False, True, True, True]]), boxes=found.boxes - [300.0, 0.0, 0.0, 0.0])
    assert cut.residuals(ALIGNED)[0, 0] == 0.0
    assert found.residuals(ALIGNED)[0, 1:] == pytest.approx(cut.residuals(ALIGNED)[0, 1:], abs=3.0)


def test_what_is_partly_behind_the_camera_is_far_from_every_box():
    found = table(frames=1, cars=1, walls=0)
    whole = replace(found, whole=np.full((1, 4), True))
    corner = np.where(np.arange(found.outline.shape[1]) == 1, -1.0, 1.0)[None, :, None] * [1.0, 1.0, 1.0]
    turned = replace(whole, outline=whole.outline * corner)
    assert np.isnan(turned.extents(ALIGNED)[0]).tolist() == [True, True, True, True, False]
    off = turned.residuals(ALIGNED)[0]
    assert off[:3].tolist() == [1e3, 0.0, 1e3], "its roof says nothing"
    assert off[3] == whole.residuals(ALIGNED)[0, 3]
    foot = replace(whole, foot=-whole.foot)
    assert np.isnan(foot.extents(ALIGNED)[0]).tolist() == [False, False, False, False, True]
    assert foot.residuals(ALIGNED)[0, 3] == 1e3


def test_the_coarse_score_is_highest_at_the_right_mount():
    model, turns = FitModel("pinhole", CAMERA, SIZE), np.array([[0.0, 0, 0], [2, 0, 0], [0, -2, 0], [-8, 5, 0]])
    scores = coarse_scores(table(), model, turns, 2.0, 5.0)
    assert scores.argmax() == 0
    assert scores[0] > 1.5 * scores[3]


@pytest.mark.parametrize("behind", [False, True])
def test_the_extents_of_many_angular_models_are_those_of_each(behind: bool):
    found = table()
    if behind:
        found = replace(found, outline=found.outline * [[[-1.0, 1.0, 1.0]]])
    fast = angular_extents(found)
    for aligned in (Angular(0.001, 0.0012, 610.3, 180.7), Angular(0.0007, 0.0007, -40.0, 900.0)):
        np.testing.assert_array_equal(fast(aligned), found.extents(aligned))
    assert np.isnan(fast(Angular(0.001, 0.001, 0.0, 0.0))).any() == behind


def test_an_angular_model_is_the_one_of_its_parameters():
    model, vector = FitModel("angular", CAMERA, SIZE), np.array([-2.8, -2.7, 1.5, -0.5])
    assert model.aligned(vector) == resolve(model.params(vector), CAMERA)


def test_frames_drawn_twice_count_twice():
    found = table()
    assert len(found.taken(np.array([2, 2])).box) == 2 * len(found.taken(np.array([2])).box)
    assert found.taken(np.array([2])).extents(ALIGNED).shape == (5, 5)


def test_overlap_is_that_of_the_boxes():
    found = table(frames=1, cars=1, walls=0)
    assert found.overlap(ALIGNED)[0] > 0.8
    shifted = replace(found, boxes=found.boxes + 1000.0)
    assert shifted.overlap(ALIGNED)[0] == 0.0
