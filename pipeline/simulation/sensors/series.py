"""Random series over the frames of a drive that decay slowly, for effects that last, such as a missed vehicle.

They are generated completely from a seed, so any frame can be computed in any order."""

from __future__ import annotations

from math import sqrt

import numba
import numpy as np

from pipeline.types import F64


def lasting(seed: list[int], frames: int, correlation: F64) -> F64:
    """(frames, K) standard normal columns; correlation: (K,) autocorrelation at a lag of one frame (AR(1))."""
    fresh = np.random.default_rng(seed).standard_normal((frames, len(correlation)))
    return _carried(fresh, np.asarray(correlation, dtype=np.float64))


@numba.njit(cache=True, nogil=True)
def _carried(fresh: F64, correlation: F64) -> F64:
    out = fresh.copy()
    for k in range(out.shape[1]):
        kept = correlation[k]
        new = sqrt(1.0 - kept * kept)
        for n in range(1, len(out)):
            out[n, k] = kept * out[n - 1, k] + new * fresh[n, k]
    return out
