"""What happens to relative motion while the car turns, brakes or accelerates.

Tracks are kept in the ego frame, with velocities relative to the car. Between two frames the car's own motion changes,
and that is not a manoeuvre of anything else: in a bend at 13 m/s and 0.15 rad/s, a parked car at 20 m has a lateral
relative velocity of 3 m/s, and when the bend ends it has none. Objects keep their speed over the road instead, so the
change of the car's motion is applied to the LiDAR's tracks as a known input (Bar-Shalom, Li, Kirubarajan 2001, section
6.3.2, with the transport theorem for rotating frames).

What drives ahead turns with the road, as the car does, so its velocity is taken to turn with the car. For what stands
this makes no difference, and for what crosses or comes towards the car it is an error of 1 m/s² at 10 m/s and
0.1 rad/s, within the acceleration that the filters allow for.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np

from pipeline.common.kalman import Transition
from pipeline.types import EgoState

_STRAIGHT_RAD = 1e-6


def between(before: EgoState | None, now: EgoState | None, dt_s: float | None) -> Transition | None:
    """How ``x y vx vy`` relative to the car changes from the frame before to this one, ``dt_s`` later, for an object
    that stands, or that drives with constant speed and turns as the car does. None if own motion is unknown in either
    frame; without a yaw rate in both, the car is taken to drive straight."""
    if before is None or now is None or dt_s is None:
        return None
    first, last = before.yaw_rate_radps, now.yaw_rate_radps
    if first is None or last is None:
        first = last = 0.0
    turned, mean_mps = (first + last) / 2.0 * dt_s, (before.speed_mps + now.speed_mps) / 2.0
    # from relative velocity to that over the road, one step of it, into the new frame, and back
    to_road, to_car = np.eye(4), np.eye(4)
    to_road[2:, :2], to_car[2:, :2] = _across(first), -_across(last)
    into_frame, halfway = _turn(-turned), _turn(turned / 2.0)
    step = np.block([[into_frame, dt_s * into_frame @ halfway], [np.zeros((2, 2)), np.eye(2)]])
    along = np.array([before.speed_mps, 0.0])
    driven = mean_mps * dt_s * np.array(_arc(turned))
    offset = to_car @ np.concatenate([into_frame @ (dt_s * halfway @ along - driven), along])
    offset[2] -= now.speed_mps
    return Transition(to_car @ step @ to_road, offset)


def _turn(angle_rad: float) -> np.ndarray:
    """(2, 2) rotation to the left."""
    return np.array([[cos(angle_rad), -sin(angle_rad)], [sin(angle_rad), cos(angle_rad)]])


def _across(rate_radps: float) -> np.ndarray:
    """(2, 2) ω × r as a matrix."""
    return np.array([[0.0, -rate_radps], [rate_radps, 0.0]])


def _arc(turned: float) -> tuple[float, float]:
    """Chord of an arc of length 1 that turns by this angle, in the frame at its start."""
    if abs(turned) < _STRAIGHT_RAD:
        return 1.0, turned / 2.0
    return sin(turned) / turned, (1.0 - cos(turned)) / turned
