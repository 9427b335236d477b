"""The arc ahead of a turning car, and how far it is good for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.params import PathParams
from pipeline.path import yaw_rate
from pipeline.path.yaw_rate import YawRate
from pipeline.types import EgoState

PARAMS = PathParams()


def ego(speed_mps: float = 20.0, yaw: float | None = 0.1) -> EgoState:
    return EgoState(0, speed_mps, yaw)


def followed(rates: list[float | None], speed_mps: float = 20.0, params: PathParams = PARAMS) -> YawRate | None:
    yaw = None
    for k, rate in enumerate(rates):
        yaw = yaw_rate.follow(yaw, ego(speed_mps, rate), 0.1 if k else None, params)
    return yaw


def test_the_arc_is_the_true_one_and_not_twice_as_curved() -> None:
    """20 m/s and 0.1 rad/s, 20 m ahead: r(1 − cos θ) = 1.00 m. Apollo's virtual lane has 2.00 m."""
    path = yaw_rate.ahead(followed([0.1] * 20), ego(), PARAMS)
    assert path is not None
    assert path.center[20, 1] == pytest.approx(200.0 * (1.0 - math.cos(0.1)), abs=2e-3)
    assert path.center[20, 0] == pytest.approx(200.0 * math.sin(0.1), abs=2e-3)


def test_noise_is_smoothed_and_a_bend_is_followed() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.004, 200)
    steady = followed((0.05 + noise).tolist())
    assert steady is not None
    assert steady.rate_radps == pytest.approx(0.05, abs=0.004)
    assert steady.variance < PARAMS.yaw_rate_sigma_radps**2 / 2
    entered = followed([0.0] * 10 + [0.1] * 8)
    assert entered is not None
    assert entered.rate_radps > 0.08, "eight frames after a step it has been followed"


@pytest.mark.parametrize(
    ("rate", "left"),
    [
        pytest.param(0.002, 0.05, id="a driver's correction is no bend"),
        pytest.param(0.03, 0.95, id="a bend of 660 m radius at 20 m/s is one"),
    ],
)
def test_below_the_noise_the_road_is_straight(rate: float, left: float) -> None:
    path = yaw_rate.ahead(YawRate(rate, 1e-6), ego(), PARAMS)
    assert path is not None
    share = path.center[60, 1] / (0.5 * rate / 20.0 * 60.0**2)
    assert share < left if left < 0.5 else share > left


@pytest.mark.parametrize("broken", [None, math.nan, math.inf, -40.0])
def test_what_no_car_can_do_is_not_measured_and_makes_it_less_sure(broken: float | None) -> None:
    before, after = followed([0.1] * 10), followed([0.1] * 10 + [broken] * 10)
    assert before is not None
    assert after is not None
    assert after.rate_radps == before.rate_radps
    assert after.variance > 2.0 * before.variance
    sure, unsure = (yaw_rate.ahead(yaw, ego(), PARAMS) for yaw in (before, after))
    assert sure is not None
    assert unsure is not None
    assert np.all(unsure.sigma_m[1:] > sure.sigma_m[1:])


@pytest.mark.parametrize(
    "state",
    [
        pytest.param(None, id="no ego state"),
        pytest.param(ego(0.5, 0.3), id="too slow"),
        pytest.param(ego(math.nan, 0.1), id="speed not a number"),
    ],
)
def test_no_arc_without_a_speed_that_means_a_curve(state: EgoState | None) -> None:
    assert yaw_rate.follow(YawRate(0.1, 1e-4), state, 0.1, PARAMS) is None


def test_the_look_ahead_is_one_of_time() -> None:
    """At any speed, the sigma reaches one metre after about the same time, so twice as far at twice the speed."""
    reach_s = []
    for speed in (10.0, 20.0, 40.0):
        path = yaw_rate.ahead(YawRate(0.0, 1e-6), ego(speed), PARAMS)
        assert path is not None
        assert np.all(np.diff(path.sigma_m) > 0.0), "it grows ahead"
        reach_s.append(float(np.argmax(path.sigma_m > 1.0)) / speed)
    assert reach_s == pytest.approx([reach_s[0]] * 3, rel=0.2)
    assert 1.5 < reach_s[0] < 3.0
