"""A machine whose speed changes during a benchmark is recognised by a fixed loop."""

from __future__ import annotations

import pytest

from app.bench.calibration import Calibration, speed_warning


@pytest.mark.parametrize(
    ("least_ms", "most_ms", "is_said"),
    [(2.0, 2.0, False), (2.0, 2.2, False), (2.0, 2.4, True), (2.0, 9.0, True)],
)
def test_a_changed_speed_is_said(least_ms: float, most_ms: float, is_said: bool) -> None:
    warning = speed_warning({"cpu_min_ms": least_ms, "cpu_max_ms": most_ms})
    assert (warning is not None) is is_said
    assert not is_said or f"{least_ms:.2f} to {most_ms:.2f} ms" in (warning or "")


def test_the_row_is_that_of_a_stage_and_its_loop_is_real_work() -> None:
    calibration = Calibration()
    calibration.sample()
    row = calibration.row()
    assert row["samples"] == 2
    assert row["peers"] == {}
    assert 0.0 < row["cpu_min_ms"] <= row["cpu_ms"] <= row["cpu_max_ms"]
    calibration._cpu_s = [2e-3, 2e-3, 3e-3]
    assert speed_warning(calibration.row()) is not None
