"""Structure of earlier sweeps that rays now pass through is gone; what they cannot see stays."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.path import road_structure, vanished
from tests.pipeline.path.test_road_structure import HEIGHT_M, box, cells_of, swept

ORIGIN = (0.0, 0.0, 0.0)
CAR = box(20.0, 0.5, 4.0, 1.8, 1.5)
WALL_BEHIND = box(30.0, 0.0, 0.4, 30.0, 2.5)
TRUCK_BEFORE = box(12.0, 0.3, 3.0, 2.5, 3.0)
BESIDE = box(20.0, 20.0, 30.0, 0.6, 4.0)
"""Returns that keep every ring working."""
HEDGE = box(20.0, 6.0, 30.0, 0.6, 1.5)


@pytest.mark.parametrize(
    ("was", "now", "gone"),
    [
        pytest.param([CAR], [], False, id="a missing return says nothing"),
        pytest.param([CAR], [WALL_BEHIND], True, id="rays return from behind it"),
        pytest.param([CAR], [CAR], False, id="it still stands there"),
        pytest.param([HEDGE], [HEDGE, CAR], False, id="a hedge beside a car"),
        pytest.param([CAR], [TRUCK_BEFORE], False, id="hidden by something nearer"),
    ],
)
def test_only_what_rays_pass_through_is_gone(was: list[list[float]], now: list[list[float]], gone: bool) -> None:
    cells = cells_of(swept(np.array(was)))
    before = len(cells.xy)
    assert before > 2
    sweep = swept(np.array([*now, BESIDE]))
    left = road_structure.standing(cells, sweep.points, sweep.ring, ORIGIN, HEIGHT_M)
    assert len(left.xy) <= 0.1 * before if gone else len(left.xy) >= 0.9 * before


def test_a_kerb_stays_although_rays_pass_over_it() -> None:
    kerb = np.array([box(20.0, -4.0, 60.0, 2.0, 0.12)])
    cells = cells_of(swept(kerb))
    assert len(cells.xy) > 10
    sweep = swept(np.array([WALL_BEHIND]))
    assert len(road_structure.standing(cells, sweep.points, sweep.ring, ORIGIN, HEIGHT_M).xy) == len(cells.xy)


def test_without_cells_or_points_nothing_is_gone() -> None:
    sweep = swept(np.array([CAR]))
    nothing = np.zeros((0, 4), np.float32)
    assert vanished.is_gone(np.zeros((0, 2)), np.zeros(0), sweep.points, sweep.ring, ORIGIN, HEIGHT_M, 0.5).shape == (
        0,
    )
    assert not vanished.is_gone(
        np.ones((1, 2)), np.zeros(1), nothing, np.zeros(0, np.uint8), ORIGIN, HEIGHT_M, 0.5
    ).any()
