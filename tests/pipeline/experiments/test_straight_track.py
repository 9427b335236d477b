"""What a drive's figures mean, on drives made by hand, and where gaps are measured to."""

from __future__ import annotations

import pytest

from pipeline.experiments.straight_track import DriveRecord, approach, gap_m, parameters, scene, true_range_m
from pipeline.simulation.closed_loop import Setup
from pipeline.simulation.world import world_state


def by_hand(accel_mps2: list[float], speed_mps: list[float], impact_mps: float | None = None) -> DriveRecord:
    n = len(accel_mps2)
    times = tuple(0.1 * k for k in range(n))
    gaps = tuple(10.0 - k for k in range(n))
    return DriveRecord(
        times, tuple(speed_mps), tuple(accel_mps2), gaps, (0.0,) * n, (None,) * n, ("off",) * n, None, None, impact_mps
    )


def test_mean_deceleration_is_of_the_hardest_braking_alone() -> None:
    drive = by_hand([0.0, -1.0, 0.0, -4.0, -8.0, -4.0, 0.0], [20.0, 20.0, 19.9, 19.9, 19.5, 18.7, 18.3])
    assert drive.mean_decel_mps2() == pytest.approx((19.9 - 18.7) / 0.2)
    assert drive.peak_decel_mps2() == 8.0
    assert drive.peak_jerk_mps3() == pytest.approx(40.0)
    assert by_hand([0.0, 0.1], [20.0, 20.0]).mean_decel_mps2() is None


def test_an_impact_leaves_no_gap() -> None:
    assert by_hand([0.0] * 3, [5.0] * 3).smallest_gap_m == 8.0
    assert by_hand([0.0] * 3, [5.0] * 3, 5.0).smallest_gap_m == 0.0


def test_gap_is_to_the_rear_and_range_to_the_nearest_point() -> None:
    scenario = scene({0.0: 10.0}, {"ahead_m": 30.0, "speed_mps": {0.0: 0.0}, "offset_m": 4.0}, 1.0, 0)
    target = world_state.at(scenario, 0.0).actors[0]
    assert gap_m(target) == pytest.approx(30.0)
    assert true_range_m(target) == pytest.approx((30.0**2 + (4.0 - 0.91) ** 2) ** 0.5)


def test_without_brakes_the_impact_is_at_full_speed() -> None:
    params = parameters("ACC", 10.0, {"acc.brake_limit_mps2": 0.0})
    drive = approach(scene({0.0: 10.0}, {"ahead_m": 20.0, "speed_mps": {0.0: 0.0}}, 5.0, 0), Setup(params, "lidar"))
    assert drive.impact_mps == pytest.approx(10.0, abs=0.3)
    assert drive.t_s[-1] == pytest.approx(2.0, abs=0.15)


def test_it_ends_when_the_car_has_slowed_to_a_target_that_drives_on() -> None:
    target = {"ahead_m": 40.0, "speed_mps": {0.0: 6.0}}
    drive = approach(scene({0.0: 14.0}, target, 30.0, 0), Setup(parameters("AEB", 14.0), "lidar"))
    assert drive.impact_mps is None
    assert drive.t_s[-1] < 15.0
    assert drive.speed_mps[-1] <= 6.0
