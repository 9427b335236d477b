"""The middle between two lines as a path: where the car stays in its lane, and where it leaves it."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.params import PathParams
from pipeline.path.estimates import PathEstimate, between_lines, corner_m
from pipeline.types import EgoState
from pipeline.types.lane import EgoLane, LaneLine, Side

COVARIANCE = np.diag(np.square([0.05, 5e-3, 3e-4, 5e-6]))


def middle(left_m: float, heading: float, width_m: float = 3.4, bend_per_m: float = 0.0) -> PathEstimate:
    """The estimate in a lane whose left line is at a distance of ``left_m`` and at an angle of ``heading`` to the
    car."""

    def line(side: Side, y_m: float) -> LaneLine:
        return LaneLine(side, np.array([y_m, heading, bend_per_m / 2, 0.0]), COVARIANCE, 4.0, 50.0, 1.0, 0.0)

    both = EgoLane(
        line("left", left_m), line("right", left_m - width_m), "test", 0.0, 0.0, width_m, np.array([0.0, 0.0, -0.5])
    )
    found = between_lines(both, PathParams())
    assert found is not None
    return found


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_car_that_is_about_to_cross_a_line_goes_on_as_it_points(side: float) -> None:
    """Its right side is 0.2 m from the line, and it heads for it at 3°: the path leads straight ahead from the car, not
    back to the centre of the lane 0.6 m to its left."""
    left_m = 2.3 if side > 0.0 else 1.1
    found = middle(left_m, 0.055 * side)
    assert np.abs(found.center[:30, 1]).max() < 0.35
    lane_m = 0.6 * side + 0.055 * side * found.center[20, 0]
    assert abs(found.center[20, 1]) < 0.2 * abs(lane_m)


@pytest.mark.parametrize(
    ("left_m", "heading"),
    [
        pytest.param(1.7, 0.0, id="in the middle"),
        pytest.param(2.1, 0.0, id="off the middle, along the lane"),
        pytest.param(1.7, 0.02, id="a correction of one degree"),
        pytest.param(1.1, 0.04, id="from the left line back to the middle"),
    ],
)
def test_a_car_that_stays_is_led_along_the_middle(left_m: float, heading: float) -> None:
    found = middle(left_m, heading)
    x = found.center[:40, 0]
    assert found.center[:40, 1] == pytest.approx(left_m - 1.7 + heading * x, abs=0.08)


def test_between_the_two_it_is_open() -> None:
    """If neither crossing nor staying is certain, the estimate is less certain than in both cases."""
    sure, open_ = middle(1.7, 0.0), middle(2.0, 0.03)
    assert open_.sigma_m[20] > sure.sigma_m[20] + 0.15


@pytest.mark.parametrize(
    ("speed_kmh", "at_15_m"),
    [
        pytest.param(15.0, (1.0, 3.0), id="slow enough for a street corner"),
        pytest.param(19.0, (0.5, 1.5), id="for a wide one"),
        pytest.param(24.0, (0.0, 0.0), id="too fast for any corner"),
        pytest.param(None, (0.0, 0.0), id="speed not known"),
    ],
)
def test_a_slow_car_may_turn_at_a_corner(speed_kmh: float | None, at_15_m: tuple[float, float]) -> None:
    found = corner_m(EgoState(0, speed_kmh / 3.6, 0.0) if speed_kmh else None, PathParams())
    assert at_15_m[0] <= found[15] <= at_15_m[1]
    assert found[3] < 0.05, "the next metres are certain at any speed"
