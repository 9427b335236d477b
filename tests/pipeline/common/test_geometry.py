"""Boxes and their overlap."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.geometry import covered_share, iou_matrix

SMALL = np.array([[0.0, 0.0, 2.0, 1.0]])
LARGE = np.array([[1.0, -5.0, 9.0, 5.0], [3.0, 0.0, 4.0, 1.0]])


def test_covered_share_is_of_the_first_box() -> None:
    assert covered_share(SMALL, LARGE).tolist() == [[0.5, 0.0]]
    assert covered_share(LARGE, SMALL)[0, 0] == pytest.approx(1.0 / 80.0)


def test_iou_is_of_both() -> None:
    assert iou_matrix(SMALL, LARGE)[0].tolist() == pytest.approx([1.0 / 81.0, 0.0])
    assert iou_matrix(LARGE, SMALL)[:, 0].tolist() == pytest.approx([1.0 / 81.0, 0.0])
