"""Structure of earlier sweeps that rays now pass through is gone; what they cannot see stays."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.path import road_structure, vanished
from tests.pipeline.path.test_road_structure import HEIGHT_M, box, cells_of, swept

CAR = box(20.0, 0.5, 4.0, 1.8, 1.5)
WALL_BEHIND = box(30.0, 0.0, 0.4, 30.0, 2.5)
TRUCK_BEFORE = box(12.0, 0.3, 3.0, 2.5, 3.0)
BESIDE = box(20.0, 20.0, 30.0, 0.6, 4.0)
"""Keeps every ring working."""
HEDGE = box(20.0, 6.0, 30.0, 0.6, 1.5)
FAR_CAR = box(42.0, 0.0, 4.0, 1.8, 1.5)


@pytest.mark.parametrize(
    ("was", "now", "gone"),
    [
        pytest.param([CAR], [], True, id="nothing returns from there any more"),
        pytest.param([CAR], [WALL_BEHIND], True, id="rays return from behind it"),
        pytest.param([CAR], [CAR], False, id="it still stands there"),
        pytest.param([HEDGE], [HEDGE, CAR], False, id="a hedge beside a car"),
        pytest.param([CAR], [TRUCK_BEFORE], False, id="hidden by something nearer"),
        pytest.param([FAR_CAR], [], False, id="so far that a missing return says nothing"),
    ],
)
def test_only_what_rays_pass_through_is_gone(was: list[list[float]], now: list[list[float]], gone: bool) -> None:
    cells = cells_of(swept(np.array(was)))
    before = len(cells.xy)
    assert before > 2
    sweep = swept(np.array([*now, BESIDE]))
    left = road_structure.standing(cells, sweep.points, sweep.ring, (0.0, 0.0, 0.0))
    assert len(left.xy) <= 0.1 * before if gone else len(left.xy) >= 0.9 * before


def test_a_kerb_stays_although_rays_pass_over_it() -> None:
    kerb = np.array([box(20.0, -4.0, 60.0, 2.0, 0.12)])
    cells = cells_of(swept(kerb))
    assert len(cells.xy) > 10
    sweep = swept(np.array([WALL_BEHIND]))
    assert len(road_structure.standing(cells, sweep.points, sweep.ring, (0.0, 0.0, 0.0)).xy) == len(cells.xy)


def test_a_dead_ring_is_no_evidence() -> None:
    cells = cells_of(swept(np.array([CAR])))
    sweep = swept(np.zeros((0, 13)))
    low = sweep.points[:, 2] < -HEIGHT_M + 0.05
    only_near = low & (np.hypot(*sweep.points[:, :2].T) < 8.0)  # the rings that meet the car have no return at all
    gone = vanished.is_gone(cells.xy, cells.z_m, sweep.points[only_near], sweep.ring[only_near], (0.0, 0.0, 0.0), 0.5)
    assert not gone.any()


def test_without_cells_or_points_nothing_is_gone() -> None:
    sweep = swept(np.array([CAR]))
    nothing = np.zeros((0, 4), np.float32)
    assert vanished.is_gone(np.zeros((0, 2)), np.zeros(0), sweep.points, sweep.ring, (0.0, 0.0, 0.0), 0.5).shape == (0,)
    assert not vanished.is_gone(np.ones((1, 2)), np.zeros(1), nothing, np.zeros(0, np.uint8), (0, 0, 0), 0.5).any()
