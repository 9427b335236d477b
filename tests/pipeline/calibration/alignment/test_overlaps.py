"""An angular model covers the boxes as well as it can."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.calibration.alignment.models import FitModel
from pipeline.calibration.alignment.overlaps import most_overlap, overlaps_of
from pipeline.calibration.alignment.pairs import PairTable
from pipeline.params import AlignmentParams
from tests.pipeline.calibration.alignment.made_drive import CAMERA, SIZE, drive

MODEL = FitModel("angular", CAMERA, SIZE)
TRUE = np.array([np.log(0.062), np.log(0.063), 2.0, -1.0])


def test_the_search_ends_where_no_neighbour_covers_more():
    table = PairTable.of(drive(MODEL.aligned(TRUE)))
    start = TRUE + np.array([0.06, -0.05, 0.4, -0.3])
    found = most_overlap(table, MODEL, start)
    before, after, true = overlaps_of(table, MODEL, [start, found, TRUE])
    assert after.mean_iou > before.mean_iou + 0.03
    assert after.mean_iou > true.mean_iou - 0.005
    around = np.vstack([np.diag([0.02, 0.02, 0.2, 0.2]), -np.diag([0.02, 0.02, 0.2, 0.2])])
    assert max(each.mean_iou for each in overlaps_of(table, MODEL, found + around)) < after.mean_iou + 0.002


def test_a_pinhole_lens_is_covered_better_than_by_its_edges_alone():
    pinhole = FitModel("pinhole", CAMERA, SIZE).aligned(np.zeros(3))
    table = PairTable.of(drive(pinhole))
    own = MODEL.vector(AlignmentParams())
    assert own is not None
    before, after = overlaps_of(table, MODEL, [own, most_overlap(table, MODEL, own)])
    assert after.mean_iou > before.mean_iou


def test_boxes_that_nothing_covers_change_nothing():
    table = PairTable.of(drive(MODEL.aligned(TRUE), cars=0))
    far = TRUE + np.array([0.0, 0.0, 40.0, 0.0])
    assert most_overlap(table, MODEL, far) == pytest.approx(far)
    assert overlaps_of(table, MODEL, [far])[0].boxes == 0
