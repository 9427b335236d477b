"""Elevation of a way as the simulator has it: one parabola ahead of the car, whose curvature changes along the road."""

from __future__ import annotations

from math import ceil

import numpy as np

from pipeline.types import F64

_STEP_M, _AHEAD_M = 5.0, 80.0
_LEAST_PER_M = 1e-6
"""Less vertical curvature than this lifts nothing by 1 cm within 100 m."""
_MOST_PER_M = 1.0 / 300.0
"""The simulator's sharpest crest."""
_WORTH_SAYING_M = 0.1


def humps(s_m: F64, height_m: F64) -> tuple[tuple[tuple[float, float], ...], str | None]:
    """Vertical curvature (s, 1/m; positive on a crest) every few metres, from heights (N,) at (N,) s, and a note about
    what that leaves out. Least squares over the next 80 m, relative to the slope on which the car stands, which tilts
    it with the road. None for a road of one slope."""
    at_m = np.linspace(s_m[0], s_m[-1], ceil((s_m[-1] - s_m[0]) / _STEP_M) + 1)
    ahead = np.arange(_STEP_M, _AHEAD_M + _STEP_M, _STEP_M)
    low, high = (np.clip(at_m + shift, s_m[0], s_m[-1]) for shift in (-1.0, 1.0))
    slope = (np.interp(high, s_m, height_m) - np.interp(low, s_m, height_m)) / (high - low)
    there = at_m[:, None] + ahead
    plane = np.interp(at_m, s_m, height_m)[:, None] + slope[:, None] * ahead
    lift = np.where(there <= s_m[-1], np.interp(there, s_m, height_m) - plane, 0.0)
    weight = np.where(there <= s_m[-1], ahead**4, 0.0).sum(axis=1)
    curvature = -2.0 * (lift @ ahead**2) / np.maximum(weight, ahead[0] ** 4)
    if np.abs(curvature).max() < _LEAST_PER_M:
        return (), None
    curvature = np.clip(curvature, -_MOST_PER_M, _MOST_PER_M)
    error_m = float(np.abs(np.where(there <= s_m[-1], lift + curvature[:, None] * ahead**2 / 2.0, 0.0)).max())
    note = None
    if error_m > _WORTH_SAYING_M:
        note = (
            f"The road's elevation is simulated as one crest or sag ahead of the car, within {error_m:.1f} m of the "
            f"file's over {_AHEAD_M:g} m."
        )
    return tuple(zip(at_m.tolist(), curvature.tolist(), strict=True)), note
