"""The road ahead as one curve: what it is fitted to, and how sure it is beyond its returns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.lidar.road_profile import ASIDE_M, MIN_RETURNS, RoadProfile, fit_road_profile
from pipeline.types import F32, F64, Mask

RINGS_M = np.array([4.0, 5.0, 6.3, 8.0, 10.5, 14.0, 20.0, 28.0])
"""Where the rings of a VLP-16 meet a flat road."""


def road(
    height_m: float = -0.8, slope: float = 0.0, curvature: float = 0.0, cross: float = 0.0, noise_m: float = 0.02
) -> F32:
    """Points of rings on a road."""
    rng = np.random.default_rng(1)
    x, y = np.meshgrid(RINGS_M, np.linspace(-5.0, 5.0, 60))
    x, y = x.ravel(), y.ravel()
    z = height_m + slope * x + curvature * x * x / 2 + cross * y + rng.normal(0.0, noise_m, x.size)
    return np.column_stack([x, y, z, np.zeros(x.size)]).astype(np.float32)


def every(points: F32) -> Mask:
    return np.ones(len(points), dtype=np.bool_)


def height(profile: RoadProfile, x: F64) -> F64:
    value: F64 = np.column_stack([np.ones_like(x), x, x * x / 2, np.zeros_like(x)]) @ profile.mean
    return value


@given(st.floats(-2.0, -0.3), st.floats(-0.06, 0.06), st.floats(-1 / 1500, 1 / 1500), st.floats(-0.03, 0.03))
def test_its_sigma_holds_where_there_are_no_returns(
    height_m: float, slope: float, curvature: float, cross: float
) -> None:
    profile = fit_road_profile(*(lambda points: (points, every(points)))(road(height_m, slope, curvature, cross)))
    assert profile is not None
    x = np.array([10.0, 25.0, 40.0, 60.0])
    off = height(profile, x) - (height_m + slope * x + curvature * x * x / 2)
    assert (np.abs(off) < 3.0 * profile.height_sigma_m(x) + 0.01).all()


def test_it_is_sure_where_it_has_returns_and_less_so_the_farther_beyond() -> None:
    points = road()
    profile = fit_road_profile(points, every(points))
    assert profile is not None
    sigma = profile.height_sigma_m(np.array([10.0, 30.0, 50.0, 70.0]))
    assert sigma[0] < 0.02
    assert (np.diff(sigma) > 0.0).all()
    assert 0.1 < sigma[2] < 0.3


@pytest.mark.parametrize(
    ("case", "faster_mps", "slower_mps"),
    [("on a motorway", 33.0, 14.0), ("in town", 14.0, 7.0), ("unknown", 30.0, None)],
)
def test_roads_for_fast_traffic_bend_less(case: str, faster_mps: float, slower_mps: float | None) -> None:
    points = road()
    fast, slow = (fit_road_profile(points, every(points), speed) for speed in (faster_mps, slower_mps))
    assert fast is not None
    assert slow is not None
    far = np.array([60.0])
    assert fast.height_sigma_m(far) < slow.height_sigma_m(far), case


def test_what_was_wrongly_taken_for_road_does_not_bend_it() -> None:
    points, kerb = road(), road(-0.6)[::8]
    both = np.vstack([points, kerb])
    clean, mixed = fit_road_profile(points, every(points)), fit_road_profile(both, every(both))
    assert clean is not None
    assert mixed is not None
    x = np.array([20.0, 40.0])
    assert height(mixed, x) == pytest.approx(height(clean, x), abs=0.06)


def test_what_is_no_road_ahead_does_not_count() -> None:
    points = road()
    behind, aside, obstacle = points.copy(), points.copy(), points.copy()
    behind[:, 0] *= -1.0
    aside[:, 1] += 2.0 * ASIDE_M
    obstacle[:, 2] += 1.0
    table = np.vstack([points, behind, aside, obstacle])
    mask = np.repeat([True, True, True, False], len(points))
    alone, among = fit_road_profile(points, every(points)), fit_road_profile(table, mask)
    assert alone is not None
    assert among is not None
    assert among.mean == pytest.approx(alone.mean)


@pytest.mark.parametrize("count", [0, 1, MIN_RETURNS - 1])
def test_few_returns_are_no_road(count: int) -> None:
    points = road()[:count]
    assert fit_road_profile(points, every(points)) is None
