"""Motion compensation, on a simulated car that drives and turns past things that stand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.lidar.deskew import deskew
from pipeline.params import DeskewParams
from pipeline.simulation.sensors.lidar.model import LidarModel
from pipeline.simulation.sensors.lidar.scene import WALL
from pipeline.simulation.sensors.lidar.sensor import Lidar
from pipeline.types import F64, EgoState, Sweep

ON = DeskewParams(enabled=True)
FLAT = np.array([-1.5, 0.0, 0.0, 0.0])


def seen(x: float, y: float, yaw: float, speed_mps: float, yaw_rate_radps: float) -> Sweep:
    """The raw sweep of a static box, 4.5 m by 1.8 m, from a car that drives and turns, without noise. In the ego frame,
    static objects move by −v and rotate about the origin by −ω."""
    velocity = (yaw_rate_radps * y - speed_mps, -yaw_rate_radps * x)
    box = np.array(
        [[x, y, -0.7, 2.25, 0.9, 0.8, np.cos(yaw), np.sin(yaw), WALL, *velocity, -yaw_rate_radps, 3.0]],
        dtype=np.float64,
    )
    lidar = Lidar(LidarModel(range_sigma_m=0.0, dropout=0.0))
    sweep = lidar.sweep_of(box, FLAT, np.random.default_rng(0), 0)
    on_box = sweep.points[:, 2] > -1.3
    assert sweep.time_s is not None
    return Sweep(0, sweep.points[on_box], sweep.ring[on_box], 16, sweep.time_s[on_box])


def off_the_box_m(sweep: Sweep, x: float, y: float, yaw: float) -> F64:
    """Distance of each point from the outline of the box at the tick."""
    c, s = np.cos(yaw), np.sin(yaw)
    dx, dy = sweep.points[:, 0] - x, sweep.points[:, 1] - y
    along, across = np.abs(dx * c + dy * s) - 2.25, np.abs(dy * c - dx * s) - 0.9
    outside = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
    return np.where(np.maximum(along, across) > 0.0, outside, -np.maximum(along, across)).astype(np.float64)


@pytest.mark.parametrize(
    ("x", "y", "yaw", "speed_mps", "yaw_rate_radps"),
    [
        (6.0, 6.0, 0.3, 30.0, 0.0),
        (8.0, -7.0, 0.0, 30.0, 0.0),
        (12.0, 9.0, 0.0, 15.0, 0.5),
        (6.0, -5.0, 1.2, 10.0, -0.8),
    ],
    ids=["left", "right", "in a left turn", "in a sharp right turn"],
)
def test_a_standing_car_gets_its_outline_back(
    x: float, y: float, yaw: float, speed_mps: float, yaw_rate_radps: float
) -> None:
    raw = seen(x, y, yaw, speed_mps, yaw_rate_radps)
    straight = deskew(raw, EgoState(0, speed_mps, yaw_rate_radps), ON)
    assert straight is not None
    before, after = off_the_box_m(raw, x, y, yaw), off_the_box_m(straight, x, y, yaw)
    assert len(raw.points) > 100
    assert np.percentile(before, 95) > 0.08
    assert np.percentile(after, 95) < 0.01
    assert np.array_equal(straight.points[:, 2:], raw.points[:, 2:])


def test_a_rear_seen_aslant_becomes_straight() -> None:
    """The rear of a car standing at an angle, 40° to the left at 25 m/s: its points lie on one line again."""
    raw = seen(7.0, 6.0, 0.0, 25.0, 0.0)
    straight = deskew(raw, EgoState(0, 25.0), ON)
    assert straight is not None

    def bend_m(sweep: Sweep) -> float:
        rear = (sweep.points[:, 1] > 5.15) & (sweep.points[:, 1] < 6.8)
        return float(np.ptp(sweep.points[rear, 0]))

    assert bend_m(raw) > 0.05
    assert bend_m(straight) < 0.005


@pytest.mark.parametrize(
    ("ego", "params", "with_times"),
    [(EgoState(0, 30.0), DeskewParams(), True), (None, ON, True), (EgoState(0, 30.0), ON, False)],
    ids=["off", "no own speed", "no times"],
)
def test_nothing_is_touched(ego: EgoState | None, params: DeskewParams, with_times: bool) -> None:
    raw = seen(6.0, 6.0, 0.0, 30.0, 0.0)
    sweep = raw if with_times else Sweep(raw.t_ns, raw.points, raw.ring, raw.channels)
    assert deskew(sweep, ego, params) is sweep
    assert deskew(None, ego, params) is None


@given(
    st.floats(-40.0, 60.0),
    st.floats(-1.0, 1.0),
    st.floats(-0.06, 0.06),
    st.floats(-100.0, 100.0),
    st.floats(-50.0, 50.0),
)
def test_it_is_the_exact_motion(speed_mps: float, yaw_rate_radps: float, tau_s: float, x: float, y: float) -> None:
    points = np.array([[x, y, 0.5, 7.0]], dtype=np.float32)
    sweep = Sweep(0, points, np.zeros(1, np.uint8), 16, np.array([tau_s], dtype=np.float32))
    moved = deskew(sweep, EgoState(0, speed_mps, yaw_rate_radps), ON)
    assert moved is not None
    turned, steps = yaw_rate_radps * tau_s, np.linspace(0.0, tau_s, 2001)
    headings = yaw_rate_radps * steps
    travelled = speed_mps * np.trapezoid(np.column_stack([np.cos(headings), np.sin(headings)]), steps, axis=0)
    exact = (
        np.cos(turned) * x - np.sin(turned) * y + travelled[0],
        np.sin(turned) * x + np.cos(turned) * y + travelled[1],
    )
    assert moved.points[0, :2] == pytest.approx(exact, abs=1e-4)
