"""Points that lie still on the ground, seen from a car that moves on."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.path.ground_points import now_at
from pipeline.types import EgoState


@pytest.mark.parametrize(
    ("speed_mps", "rate_radps", "expected"),
    [
        pytest.param(10.0, 0.0, (19.0, 2.0), id="straight on: nearer by the way driven"),
        pytest.param(10.0, None, (19.0, 2.0), id="no yaw rate known: straight on"),
        pytest.param(0.0, 0.1, (20.0 + 2.0 * 0.01, 2.0 - 20.0 * 0.01), id="a left turn on the spot: off to the right"),
    ],
)
def test_where_a_point_is_a_tenth_of_a_second_later(
    speed_mps: float, rate_radps: float | None, expected: tuple[float, float]
) -> None:
    found = now_at(np.array([[20.0, 2.0]]), EgoState(0, speed_mps, rate_radps), 0.1)
    assert found[0] == pytest.approx(expected, abs=2e-3)


def test_steps_add_up_to_the_arc() -> None:
    """After a quarter circle of 10 m radius, the place where it ends is the origin."""
    ego, points = EgoState(0, np.pi / 2 * 10.0, np.pi / 2), np.array([[10.0, 10.0]])
    for _ in range(100):
        points = now_at(points, ego, 0.01)
    assert points[0] == pytest.approx([0.0, 0.0], abs=1e-3)
