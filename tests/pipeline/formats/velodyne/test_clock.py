"""Microseconds past some hour → nanoseconds."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.formats.velodyne import SensorClock

HOUR_US = 3_600_000_000
UTC_NS = 1_453_364_282_342_001_000
"""2016-01-21 08:18:02.342001."""


def test_host_time_begins_where_the_shortest_way_says() -> None:
    """Queues delay packets, and never make them earlier."""
    clock, rng = SensorClock(), np.random.default_rng(0)
    for us in range(0, 5_000_000, 1_327):
        clock.observe(us, UTC_NS + us * 1000 + int(rng.exponential(2e6)))
    assert clock.reference == "host"
    assert clock.to_ns(5_000_000) == pytest.approx(UTC_NS + 5_000_000_000, abs=300_000)


def test_steps_are_the_sensors_own() -> None:
    clock, rng = SensorClock(), np.random.default_rng(1)
    times = []
    for us in range(0, 2_000_000, 100_000):
        clock.observe(us, UTC_NS + us * 1000 + int(rng.uniform(0, 50e6)))
        times.append(clock.to_ns(us))
    assert np.abs(np.diff(times[10:]) - 100_000_000).max() < 10_000


def test_crystals_drift_apart() -> None:
    clock = SensorClock()
    for us in range(0, 600_000_000, 100_000):
        clock.observe(us, UTC_NS + round(us * 1000 * (1 + 30e-6)))
    assert clock.to_ns(600_000_000) == pytest.approx(UTC_NS + 600e9 * (1 + 30e-6), abs=10_000)


@pytest.mark.parametrize("step_s", [10.0, -10.0])
def test_host_clock_set_anew_is_followed(step_s: float) -> None:
    clock = SensorClock()
    for us in range(0, 10_000_000, 10_000):
        clock.observe(us, UTC_NS + us * 1000 + round(step_s * 1e9) * (us > 5_000_000))
    assert clock.to_ns(10_000_000) == pytest.approx(UTC_NS + 10e9 + step_s * 1e9, abs=2e6)


def test_one_stale_packet_is_not_a_clock_set_anew() -> None:
    clock = SensorClock()
    for us in range(0, 3_000_000, 10_000):
        clock.observe(us, UTC_NS + us * 1000 - (10**10 if us == 1_000_000 else 0))
    assert clock.to_ns(3_000_000) == pytest.approx(UTC_NS + 3e9, abs=1e6)


@pytest.mark.parametrize("host_off_s", [-1500.0, -0.4, 0.0, 0.4, 1500.0])
def test_gps_time_takes_only_the_hour_from_the_host(host_off_s: float) -> None:
    clock = SensorClock()
    past_hour_us = (UTC_NS // 1000) % HOUR_US
    clock.follow_gps(True)
    clock.observe(past_hour_us, UTC_NS + round(host_off_s * 1e9))
    assert clock.reference == "gps"
    assert clock.to_ns(past_hour_us) == UTC_NS
    clock.follow_gps(False)
    assert clock.to_ns(past_hour_us) == pytest.approx(UTC_NS + host_off_s * 1e9, abs=1000)


def test_no_host_time_begins_at_the_sensors_hour() -> None:
    clock = SensorClock()
    assert (clock.to_ns(1_000), clock.reference, clock.offset_ns) == (1_000_000, "sensor", None)
