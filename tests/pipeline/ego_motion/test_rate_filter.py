"""A rate from displacements."""

from __future__ import annotations

import pytest

from pipeline.ego_motion import rate_filter


def test_a_braking_car_has_its_speed_of_now_and_not_of_half_a_step_ago() -> None:
    """Braking at 3 m/s² from 20 m/s, the mean of the last 0.1 s is 0.15 m/s higher than the speed at its end."""
    now = rate_filter.start(20.0 * 0.1, 0.1, 0.01, 3.0)
    speed = 20.0
    for _ in range(20):
        moved, speed = speed * 0.1 - 3.0 * 0.005, speed - 0.3
        now = rate_filter.update(rate_filter.predict(now, 0.1, 2.0), moved, 0.1, 0.01)
    assert now.rate == pytest.approx(speed, abs=0.05)
    assert now.change == pytest.approx(-3.0, abs=0.3)
    assert now.sigma < 0.2


def test_it_grows_unsure_while_nothing_is_measured() -> None:
    now = rate_filter.start(2.0, 0.1, 0.02, 3.0)
    assert rate_filter.predict(now, 0.5, 2.0).sigma > rate_filter.predict(now, 0.1, 2.0).sigma > now.sigma
