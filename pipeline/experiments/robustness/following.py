"""Cars that follow each other according to the Intelligent Driver Model (Treiber, Hennecke and Helbing 2000): the
speeds of a script without collisions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.types import F64

STEP_S = 0.5
_ACCEL_MPS2, _DECEL_MPS2, _GAP_M, _TIME_GAP_S = 1.2, 1.8, 3.0, 1.5
_HARDEST_MPS2 = 6.0


@dataclass(frozen=True)
class Drive:
    """The motion of one car in steps of ``STEP_S``. Speed is linear between two steps, as in a script."""

    speeds_mps: F64
    """(N,) speed at each step."""
    rear_m: F64
    """(N,) position of its rear, relative to the initial position of the ego vehicle's bumper."""

    def script(self) -> dict[float, float]:
        """The speed as ``speed_mps`` of a scenario file: seconds → m/s."""
        return {round(n * STEP_S, 3): round(float(v), 3) for n, v in enumerate(self.speeds_mps)}


def wandering(rng: np.random.Generator, steps: int, usual_mps: float, rear_m: float, stops: bool) -> Drive:
    """A car with a free road ahead: its desired speed changes every few seconds, and occasionally it stops for a
    while."""
    wishes, wish, left = [], usual_mps, 0
    for _ in range(steps):
        if left <= 0:
            is_stop = stops and rng.random() < 0.2
            wish = 0.0 if is_stop else usual_mps * float(rng.uniform(0.6, 1.05))
            left = int(rng.integers(6, 24))
        wishes.append(wish)
        left -= 1
    brake = float(rng.uniform(1.0, 4.0))
    speeds = [usual_mps]
    for wish in wishes[1:]:
        speeds.append(speeds[-1] + float(np.clip(wish - speeds[-1], -brake * STEP_S, 1.2 * STEP_S)))
    return _driven(np.array(speeds), rear_m)


def steady(steps: int, speed_mps: float, rear_m: float) -> Drive:
    """A car that keeps its speed."""
    return _driven(np.full(steps, speed_mps), rear_m)


def following(
    ahead: list[tuple[int, int, Drive]], steps: int, usual_mps: float, start_mps: float, front_m: float
) -> F64:
    """Speeds of a car whose bumper starts at ``front_m``. ahead: the cars in its lane, each with its first and last
    step there."""
    speeds = np.empty(steps)
    speed, place = start_mps, front_m
    for n in range(steps):
        speeds[n] = speed
        accel = _ACCEL_MPS2 * (1.0 - (speed / max(usual_mps, 0.1)) ** 4)
        for first, last, other in ahead:
            gap = other.rear_m[n] - place
            if first <= n < last and gap > 0.0:
                closing = speed - float(other.speeds_mps[n])
                root = 2.0 * np.sqrt(_ACCEL_MPS2 * _DECEL_MPS2)
                wanted = _GAP_M + max(0.0, speed * _TIME_GAP_S + speed * closing / root)
                held = _ACCEL_MPS2 * (1.0 - (speed / max(usual_mps, 0.1)) ** 4 - (wanted / max(gap, 0.5)) ** 2)
                accel = min(accel, held)
        after = max(0.0, speed + float(np.clip(accel, -_HARDEST_MPS2, _ACCEL_MPS2)) * STEP_S)
        place += (speed + after) / 2.0 * STEP_S
        speed = after
    return speeds


def places_m(speeds_mps: F64, start_m: float) -> F64:
    """Position at each step."""
    moved = (speeds_mps[1:] + speeds_mps[:-1]) / 2.0 * STEP_S
    return start_m + np.concatenate([[0.0], np.cumsum(moved)])


def _driven(speeds_mps: F64, rear_m: float) -> Drive:
    return Drive(speeds_mps, places_m(speeds_mps, rear_m))
