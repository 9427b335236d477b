"""Statistics that a few outliers do not change."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.robust import mad_sigma


def test_it_is_the_standard_deviation_of_normal_errors_whatever_a_tenth_of_them_is() -> None:
    errors = np.random.default_rng(0).normal(0.0, 2.0, 10_000)
    assert mad_sigma(errors) == pytest.approx(2.0, rel=0.03)
    errors[:1000] = 1e6
    assert mad_sigma(errors) == pytest.approx(2.0, rel=0.2)
