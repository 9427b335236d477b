"""Ego motion while it is not measured: the last speed and yaw rate, with growing uncertainty.

If speed comes from GNSS, a lost fix removes position and speed at once. The last values remain useful for some seconds:
the speed may change by ``coast_accel_mps2`` and the yaw rate by ``coast_turn_radps2``, so their errors grow with age,
and those of the distance driven and the heading with its square. Each consumer adds the growth per tick. The path
continues until its own sigma ends it; ACC and emergency braking use the motion for at most ``coast_s``."""

from __future__ import annotations

from pipeline.common.fast_replace import evolve
from pipeline.params import MotionParams
from pipeline.types import Coasting, EgoState


def follow(
    before: EgoState | None, measured: EgoState | None, dt_s: float | None, params: MotionParams
) -> EgoState | None:
    """The measured motion; without one, the previous frame's motion, aged by ``dt_s``. None before the first
    measurement."""
    if measured is not None or before is None:
        return measured
    since_s = before.coasting.age_s if before.coasting is not None else 0.0
    age_s = since_s + (dt_s or 0.0)
    accel, turn = params.coast_accel_mps2, params.coast_turn_radps2
    squares, fourths = age_s**2 - since_s**2, 0.25 * (age_s**4 - since_s**4)
    return evolve(before, coasting=Coasting(age_s, accel**2 * fourths, turn**2 * fourths, turn**2 * squares))


def recent(own: EgoState | None, params: MotionParams) -> EgoState | None:
    """Own motion while it is recent enough to drive by; None once it has not been measured for ``coast_s``."""
    if own is None or own.coasting is None:
        return own
    return own if own.coasting.age_s <= params.coast_s else None
