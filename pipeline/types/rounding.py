"""Rounds the numbers of a result to the four decimals of the results contract, many at once: a frame holds thousands,
and Python rounds them one by one in several milliseconds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.types.arrays import F64

DECIMALS = 4
_SCALE = 10.0**DECIMALS
_CLOSE, _LARGE = 1e-4, 1e10
"""Scaled numbers this close to a half, or this large, may round differently after the multiplication: they are left to
Python, which is exact."""


def rounded(values: Sequence[float | None]) -> list[float | None]:
    """The numbers as ``round(value, 4)`` gives them; None for those that are unknown or not finite. Minus zero becomes
    zero, so that rounding noise does not change a file."""
    numbers = rounded_array(np.array(values, dtype=np.float64)).tolist()
    return [None if number != number else number for number in numbers]


def rounded_array(values: F64) -> F64:
    """The same for an array of any shape, with NaN instead of None."""
    with np.errstate(invalid="ignore", over="ignore"):
        scaled = np.where(np.isfinite(values), values, np.nan) * _SCALE
        whole = np.rint(scaled)
        is_doubtful = (np.abs(scaled) > _LARGE) | (np.abs(np.abs(scaled - whole) - 0.5) < _CLOSE)
    out: F64 = whole / _SCALE + 0.0
    for place in np.argwhere(is_doubtful).tolist():
        at = tuple(place)
        out[at] = round(float(values[at]), DECIMALS) + 0.0
    return out
