"""The simulator's speed is that of whole ticks, against the time they simulate."""

from __future__ import annotations

import pytest

from app.bench.simulation import stages


def test_both_loops_are_measured_against_real_time() -> None:
    figures = stages(0.2)
    assert figures.keys() == {"simulate_lidar", "simulate_camera"}
    for row in figures.values():
        assert 0.0 < row["median_ms"] <= row["p99_ms"]
        clock, processor = row["peers"]["real time"], row["peers"]["real time, by processor time"]
        assert clock["median_ms"] == processor["median_ms"] == 100.0, "ten ticks a second"
        # both are rounded to two digits: on a slow machine that is more than any share of a small ratio
        assert clock["ratio"] == pytest.approx(100.0 / row["median_ms"], rel=1e-3, abs=0.0051)
        assert processor["ratio"] == pytest.approx(100.0 / row["cpu_ms"], rel=1e-3, abs=0.0051)
