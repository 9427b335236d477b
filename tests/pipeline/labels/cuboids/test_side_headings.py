"""The heading of a vehicle from a straight side."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.labels.cuboids.side_headings import off_road, side_turn_rad

YAW_RAD = 0.3


def along(length_m: float, count: int, aside_m: float = 0.0) -> np.ndarray:
    """(count, 4) points of a line in the direction ``YAW_RAD``, with 2 cm of noise, this far to its left."""
    rng = np.random.default_rng(0)
    x, y = np.linspace(0.0, length_m, count), aside_m + rng.normal(0.0, 0.02, count)
    c, s = math.cos(YAW_RAD), math.sin(YAW_RAD)
    zero = np.zeros(count)
    return np.column_stack([20.0 + c * x - s * y, 5.0 + s * x + c * y, zero, zero]).astype(np.float32)


@pytest.mark.parametrize("off_deg", [-12.0, -4.0, 0.0, 9.0])
def test_a_side_seen_as_a_line_tells_the_heading(off_deg: float) -> None:
    points = np.vstack([along(3.5, 60), along(0.4, 12, aside_m=0.5)])
    turn_rad = side_turn_rad(points, YAW_RAD + math.radians(off_deg))
    assert turn_rad is not None
    assert math.degrees(turn_rad) == pytest.approx(-off_deg, abs=1.0)


def test_what_may_be_a_rear_or_shows_more_than_a_side_tells_nothing() -> None:
    assert side_turn_rad(along(1.8, 60), YAW_RAD) is None, "no longer than a rear is wide"
    assert side_turn_rad(along(3.5, 8), YAW_RAD) is None, "too few"
    rng = np.random.default_rng(1)
    body = np.vstack([along(3.5, 40), along(3.5, 60) + rng.normal(0.0, 0.8, (60, 4)).astype(np.float32)])
    assert side_turn_rad(body, YAW_RAD) is None, "most points are elsewhere"


def test_a_vehicle_is_along_the_road_unless_its_side_certainly_is_not() -> None:
    assert not off_road(math.radians(4.0))
    assert off_road(math.radians(-9.0))
