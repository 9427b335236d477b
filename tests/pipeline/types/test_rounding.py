"""Rounding many numbers at once gives what Python's exact ``round`` gives one by one."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.types.rounding import rounded, rounded_array

NUMBERS = st.floats() | st.floats(-200.0, 200.0) | st.integers(-(10**9), 10**9).map(lambda k: (k + 0.5) * 1e-4)


def one(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(value, 4) + 0.0


@given(st.lists(NUMBERS | st.none()))
def test_it_rounds_as_python_does(values: list[float | None]) -> None:
    assert list(map(repr, rounded(values))) == [repr(one(value)) for value in values]


def test_what_multiplying_would_round_wrong() -> None:
    """As doubles, 0.00025 is slightly above half of the last decimal and 0.00035 slightly below; multiplied, both
    become exact halves, which would be rounded to even."""
    assert rounded([0.00025, 0.00035, -0.00025]) == [0.0003, 0.0003, -0.0003]


def test_an_array_keeps_its_shape_and_unknowns() -> None:
    out = rounded_array(np.array([[1.23456, np.nan], [-0.00001, np.inf]]))
    assert out[0, 0] == 1.2346
    assert np.isnan(out[[0, 1], [1, 1]]).all()
    assert str(out[1, 0]) == "0.0"
