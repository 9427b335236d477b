"""Ego motion while it is not measured."""

from __future__ import annotations

import pytest

from pipeline.ego_motion.coasting import follow, recent
from pipeline.params import MotionParams
from pipeline.types import EgoState

PARAMS = MotionParams(coast_s=2.0, coast_accel_mps2=1.0, coast_turn_radps2=0.02)
DRIVING = EgoState(0, 20.0, 0.1)


def test_what_is_measured_is_taken_as_it_is() -> None:
    assert follow(None, DRIVING, 0.1, PARAMS) is DRIVING
    assert follow(None, None, 0.1, PARAMS) is None
    lost = follow(DRIVING, None, 0.1, PARAMS)
    assert follow(lost, DRIVING, 0.1, PARAMS) is DRIVING


@pytest.mark.parametrize("step_s", [0.1, 0.5, 2.0])
def test_errors_grow_with_age_however_often_a_frame_comes(step_s: float) -> None:
    """After 2 s: 2 m/s and 2 m travelled, 0.04 rad/s and 0.04 rad."""
    own: EgoState | None = DRIVING
    way = turn = rate = 0.0
    for _ in range(round(2.0 / step_s)):
        own = follow(own, None, step_s, PARAMS)
        assert own is not None
        assert own.coasting is not None
        assert (own.speed_mps, own.yaw_rate_radps) == (20.0, 0.1)
        way, turn = way + own.coasting.travelled_var_m2, turn + own.coasting.turned_var_rad2
        rate += own.coasting.rate_var_rad2ps2
    assert (way**0.5, turn**0.5, rate**0.5) == pytest.approx((2.0, 0.04, 0.04))


def test_nobody_drives_by_it_for_long() -> None:
    own = follow(DRIVING, None, 1.9, PARAMS)
    assert recent(own, PARAMS) is own
    assert recent(follow(own, None, 0.2, PARAMS), PARAMS) is None
    assert recent(DRIVING, PARAMS) is DRIVING
