"""What happens to relative motion while the car turns, brakes or accelerates.

Tracks are kept in the ego frame, with velocities relative to the car. Between two frames the car's own motion changes,
and that is not a manoeuvre of anything else: in a bend at 13 m/s and 0.15 rad/s, a parked car at 20 m has a lateral
relative velocity of 3 m/s, and when the bend ends it has none. Objects keep their velocity over the road instead, so
the change of the car's motion is applied to all of them as a known input (Bar-Shalom, Li, Kirubarajan 2001, section
6.3.2, with the transport theorem for rotating frames).
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from pipeline.common.kalman import Transition
from pipeline.types import EgoState

_STRAIGHT_RAD = 1e-6


def between(before: EgoState | None, now: EgoState | None, dt_s: float | None) -> Transition | None:
    """How ``x y vx vy`` relative to the car changes from the frame before to this one, ``dt_s`` later, for an object
    whose velocity over the road is constant. None if own motion is unknown in either frame; without a yaw rate in both,
    the car is taken to drive straight."""
    if before is None or now is None or dt_s is None:
        return None
    first, last = before.yaw_rate_radps, now.yaw_rate_radps
    if first is None or last is None:
        first = last = 0.0
    turned, mean_mps = (first + last) / 2.0 * dt_s, (before.speed_mps + now.speed_mps) / 2.0
    # from relative velocity to that over the road, one step of it, turned into the new frame, and back
    to_road, to_car = np.eye(4), np.eye(4)
    to_road[2:, :2], to_car[2:, :2] = _across(first), -_across(last)
    turn = np.array([[cos(turned), sin(turned)], [-sin(turned), cos(turned)]])
    step = np.block([[turn, dt_s * turn], [np.zeros((2, 2)), turn]])
    along = np.array([before.speed_mps, 0.0])
    driven = mean_mps * dt_s * np.array(_arc(turned))
    offset = to_car @ np.concatenate([turn @ (dt_s * along - driven), turn @ along])
    offset[2] -= now.speed_mps
    return Transition(to_car @ step @ to_road, offset)


def _across(rate_radps: float) -> np.ndarray:
    """(2, 2) ω × r as a matrix."""
    return np.array([[0.0, -rate_radps], [rate_radps, 0.0]])


def _arc(turned: float) -> tuple[float, float]:
    """Chord of an arc of length 1 that turns by this angle, in the frame at its start."""
    if abs(turned) < _STRAIGHT_RAD:
        return 1.0, turned / 2.0
    return sin(turned) / turned, (1.0 - cos(turned)) / turned
