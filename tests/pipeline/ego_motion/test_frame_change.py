"""Relative motion while the car turns and brakes, of what stands and of what drives ahead."""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common import kalman
from pipeline.ego_motion import frame_change
from pipeline.types import EgoState

DT_S = 0.1
speeds = st.floats(0.0, 40.0)
rates = st.floats(-0.6, 0.6)


def ego(speed_mps: float, rate_radps: float | None = 0.0) -> EgoState:
    return EgoState(0, speed_mps, rate_radps)


def relative(car: tuple[float, float, float], own: EgoState, at: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """x y vx vy in the frame of a car at x, y, heading, of what is at ``at`` and moves by ``velocity`` in the world."""
    x, y, heading = car
    turn = np.array([[cos(heading), sin(heading)], [-sin(heading), cos(heading)]])
    place = turn @ (at - (x, y))
    rate = own.yaw_rate_radps or 0.0
    return np.concatenate([place, turn @ velocity - (own.speed_mps, 0.0) - rate * np.array([-place[1], place[0]])])


def driven(first: EgoState, last: EgoState, steps: int = 100) -> tuple[float, float, float]:
    """Where the car is after a tenth of a second: speed and yaw rate change evenly, integrated in small steps."""
    x = y = heading = 0.0
    for n in range(steps):
        part = (n + 0.5) / steps
        speed = first.speed_mps + part * (last.speed_mps - first.speed_mps)
        rate = (first.yaw_rate_radps or 0.0) + part * ((last.yaw_rate_radps or 0.0) - (first.yaw_rate_radps or 0.0))
        middle = heading + rate * DT_S / steps / 2.0
        x, y = x + speed * cos(middle) * DT_S / steps, y + speed * sin(middle) * DT_S / steps
        heading += rate * DT_S / steps
    return x, y, heading


@given(speeds, speeds, rates, rates, st.tuples(*[st.floats(-60.0, 60.0)] * 2))
def test_what_stands_goes_on_standing(v0: float, v1: float, w0: float, w1: float, at: tuple[float, float]) -> None:
    first, last = ego(v0, w0), ego(v0 + (v1 - v0) * 0.03, w0 + (w1 - w0) * 0.1)
    change = frame_change.between(first, last, DT_S)
    assert change is not None
    before = relative((0.0, 0.0, 0.0), first, np.array(at), np.zeros(2))
    expected = relative(driven(first, last), last, np.array(at), np.zeros(2))
    assert change.matrix @ before + change.offset == pytest.approx(expected, abs=0.01)


@given(speeds, speeds, rates, rates, st.floats(0.0, 40.0), st.tuples(*[st.floats(-60.0, 60.0)] * 2))
def test_what_drives_ahead_turns_with_the_car(
    v0: float, v1: float, w0: float, w1: float, speed: float, at: tuple[float, float]
) -> None:
    first, last = ego(v0, w0), ego(v0 + (v1 - v0) * 0.03, w0 + (w1 - w0) * 0.1)
    change = frame_change.between(first, last, DT_S)
    assert change is not None
    x, y, turned = driven(ego(speed, first.yaw_rate_radps), ego(speed, last.yaw_rate_radps))
    before = relative((0.0, 0.0, 0.0), first, np.array(at), np.array([speed, 0.0]))
    later = speed * np.array([cos(turned), sin(turned)])
    expected = relative(driven(first, last), last, np.array([at[0] + x, at[1] + y]), later)
    assert change.matrix @ before + change.offset == pytest.approx(expected, abs=0.02)


def test_a_parked_car_stands_while_the_car_leaves_a_bend() -> None:
    """At 13 m/s out of a bend of 90 m: seen for half a second, then carried for half a second."""
    parked, at_rest, noise = np.array([28.0, -6.0]), np.zeros(2), 0.01 * np.eye(2)
    car, owns = (0.0, 0.0, 0.0), [ego(13.0, -0.15 + 0.015 * min(n, 10)) for n in range(12)]
    state = kalman.start(relative(car, owns[0], parked, at_rest)[:2], noise, 10.0)
    for n in range(1, 11):
        change = frame_change.between(owns[n - 1], owns[n], DT_S)
        state = kalman.predict(state, DT_S, 3.0, change)
        x, y, turned = driven(owns[n - 1], owns[n])
        heading = car[2]
        car = (
            car[0] + x * cos(heading) - y * sin(heading),
            car[1] + x * sin(heading) + y * cos(heading),
            heading + turned,
        )
        true = relative(car, owns[n], parked, at_rest)
        if n <= 5:
            state = kalman.update(state, true[:2], noise)
    assert state.mean == pytest.approx(true, abs=0.3)
    assert abs(state.mean[3]) < 0.3, "its lateral velocity ends with the bend"


@pytest.mark.parametrize(
    ("before", "now", "dt_s"),
    [(None, ego(10.0), DT_S), (ego(10.0), None, DT_S), (ego(10.0), ego(10.0), None)],
    ids=["no motion before", "no motion now", "first frame"],
)
def test_unknown_motion_changes_nothing(before: EgoState | None, now: EgoState | None, dt_s: float | None) -> None:
    assert frame_change.between(before, now, dt_s) is None


def test_without_a_yaw_rate_in_both_frames_the_car_drives_straight() -> None:
    braking = frame_change.between(ego(10.0, None), ego(9.0, 0.5), DT_S)
    assert braking is not None
    at = np.array([30.0, 0.0, -10.0, 0.0])
    assert braking.matrix @ at + braking.offset == pytest.approx([29.05, 0.0, -9.0, 0.0])
