"""A busy machine is recognised by the processor time of other programs, and an idle one is not reported."""

from __future__ import annotations

import os
import sys

import pytest

from app.bench.other_load import CpuTimes, load_warning, parse_cpu_times, read_cpu_times

BEFORE = CpuTimes(1000.0, 100.0, 5.0, 10.0)


@pytest.mark.parametrize(
    ("after", "said"),
    [
        pytest.param(CpuTimes(1100.0, 150.0, 5.0, 59.0), (), id="only this process"),
        pytest.param(CpuTimes(1100.0, 195.0, 5.0, 60.0), ("45%", "0%"), id="another program"),
        pytest.param(CpuTimes(1100.0, 150.0, 35.0, 60.0), ("0%", "30%"), id="another guest"),
        pytest.param(CpuTimes(1100.0, 130.0, 5.0, 60.0), (), id="own time is counted more finely than the system's"),
        pytest.param(BEFORE, (), id="no time between"),
        pytest.param(None, (), id="unknown"),
    ],
)
def test_what_others_took_is_said(after: CpuTimes | None, said: tuple[str, ...]) -> None:
    warning = load_warning(BEFORE, after)
    assert (warning is not None) is bool(said)
    assert all(each in (warning or "") for each in said)


def test_columns_are_the_systems() -> None:
    """user nice system idle iowait irq softirq steal guest guest_nice; user time already includes guest time."""
    times = parse_cpu_times("cpu  100 20 30 1000 50 5 5 40 60 10", 10, 7.0)
    assert times == CpuTimes(125.0, 16.0, 4.0, 7.0)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells")
def test_this_machine_tells() -> None:
    times = read_cpu_times()
    assert times is not None
    assert 0.0 < times.busy_s < times.total_s
    assert times.own_s <= sum(os.times()[:4])
