"""What later measurements reveal about earlier distances."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.evaluation.label_free.backward import look_back


def test_a_steady_approach_is_traced_back():
    t_s = np.arange(0.0, 4.0, 0.1)
    true = 60.0 - 8.0 * t_s
    ranged = np.where(t_s >= 2.0, true, np.nan)
    looked = look_back(t_s, ranged)
    assert looked.distance_m[:20] == pytest.approx(true[:20], abs=0.05)
    assert looked.closing_mps[:20] == pytest.approx(8.0, abs=0.05)
    assert np.all(np.diff(looked.sigma_m[:20]) < 0.0), "less sure the farther back"


def test_the_last_measurements_say_nothing_of_later_moments_nor_one_of_earlier_ones():
    t_s = np.arange(0.0, 2.0, 0.1)
    one = np.full(20, np.nan)
    one[10] = 30.0
    assert np.isnan(look_back(t_s, one).distance_m).all()
    two = one.copy()
    two[11] = 30.0
    looked = look_back(t_s, two)
    assert np.isnan(looked.distance_m[11:]).all()
    assert np.isfinite(looked.distance_m[:10]).all()
    assert np.isnan(look_back(t_s, np.full(20, np.nan)).sigma_m).all()


def test_errors_lie_within_what_it_says_of_itself():
    """With vehicles that brake and accelerate at random, errors in units of the stated variance are about one."""
    random = np.random.default_rng(0)
    squares = []
    for _ in range(300):
        t_s = np.arange(0.0, 4.0, 0.1)
        rate = -5.0 + np.cumsum(random.normal(0.0, 1.5 * np.sqrt(0.1), 40))
        true = 60.0 + np.cumsum(rate * 0.1)
        ranged = np.where(t_s >= 2.0, true + random.normal(0.0, 0.15, 40), np.nan)
        looked = look_back(t_s, ranged)
        squares.append(((looked.distance_m - true) / looked.sigma_m)[5] ** 2)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.35)
