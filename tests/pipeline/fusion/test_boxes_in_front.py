"""What is nearer ends farther down in the image."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.fusion.boxes_in_front import nearer

FAR = (980.0, 270.0, 1044.0, 330.0)


@pytest.mark.parametrize(
    ("case", "other", "is_nearer"),
    [
        ("it ends farther down", (900.0, 220.0, 1010.0, 370.0), True),
        ("also beside it", (300.0, 220.0, 410.0, 370.0), True),
        ("by no more than an edge's noise", (900.0, 270.0, 1010.0, 331.5), False),
        ("it ends higher up", (985.0, 240.0, 1039.0, 320.0), False),
        ("another box of the same vehicle", (978.0, 268.0, 1046.0, 334.0), False),
    ],
)
def test_which_of_two_boxes_is_nearer(case: str, other: tuple[float, float, float, float], is_nearer: bool) -> None:
    assert nearer(np.array([FAR, other]))[0, 1] == is_nearer, case
    assert not nearer(np.array([FAR])).any()
