"""Clocks of sensors on the host's timeline: delays, jumps, and GPS time by way of the LiDAR's pulse per second."""

from __future__ import annotations

import time

import pytest

from pipeline.replay.wire import WireEvent
from pipeline.sources.live.clock import FollowedClock, HostClock
from pipeline.sources.live.devices.lidar import LidarInput
from tests.pipeline.formats.velodyne.test_position import position
from tests.pipeline.sources.live.bench import MS, SECOND, START, Bench, Taken, sent

HOST_AHEAD_NS = 1_234 * MS
"""Error of the host's clock; a car has no network to set it."""
RECEIVER_TAKES_NS = 80 * MS


def test_the_hosts_timeline_goes_on_when_its_clock_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = HostClock()
    before = clock.now_ns()
    wall = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: wall() + 3600 * SECOND)
    assert 0 <= clock.now_ns() - before < 60 * SECOND
    assert abs(clock.ahead_ns() - 3600 * SECOND) < 60 * SECOND
    stamped = time.time_ns() - 5 * MS
    assert abs(clock.now_ns() - clock.of_wall_ns(stamped) - 5 * MS) < SECOND
    for impossible in (0, time.time_ns() + 10 * SECOND):
        assert clock.now_ns() - clock.of_wall_ns(impossible) < SECOND, "now, where a stamp cannot be"


def test_a_followed_clock_takes_the_shortest_way() -> None:
    clock, offset = FollowedClock(), 55_555 * SECOND
    delays_ms = [30, 12, 45, 11, 80, 12, 30, 11]
    for k, delay in enumerate(delays_ms):
        stamp = START + k * 100 * MS
        t_ns = clock.to_host_ns(stamp, stamp + offset + delay * MS)
    assert t_ns == pytest.approx(START + 7 * 100 * MS + offset + 11 * MS, abs=MS)
    assert clock.offset_ms == pytest.approx((offset + 11 * MS) / 1e6, abs=1.0)


def test_a_message_held_up_once_moves_nothing() -> None:
    clock = FollowedClock()
    for k in range(20):
        stamp = START + k * 100 * MS
        held = 900 * MS if k == 10 else 10 * MS
        assert clock.to_host_ns(stamp, stamp + held) == pytest.approx(stamp + 10 * MS, abs=MS)


@pytest.mark.parametrize(("pps", "off_ms"), [(2, 0.0), (0, 80.0)], ids=["PPS locked", "no PPS"])
def test_a_fix_is_placed_by_the_lidars_gps_time_where_it_has_one(pps: int, off_ms: float) -> None:
    """A receiver reports its position 80 ms late, which cannot be known from it alone. A LiDAR on the same receiver's
    pulse has GPS time without this delay, and relates it to the host's clock."""
    bench = Bench()
    lidar = bench.source.inputs["lidar"]
    assert isinstance(lidar, LidarInput)
    lidar.receive_position(position(pps=pps), START)
    taken = bench.drive(_delayed(sent([])))
    assert_fixes_off_by(taken, off_ms)
    offset_ms = lidar.clock_offset_ms()
    assert offset_ms is not None
    assert offset_ms == pytest.approx(HOST_AHEAD_NS / 1e6, abs=2.0)


def _delayed(events):  # type: ignore[no-untyped-def]
    """The sensors' clocks are GPS time, the host's clock is ahead of it, and the receiver's fixes arrive late."""
    moved: list[WireEvent] = []
    for event in events:
        late_ns = RECEIVER_TAKES_NS if event.sensor == "gnss" else 0
        stamp_ns = event.stamp_ns - (0 if event.sensor == "camera" else HOST_AHEAD_NS)
        moved.append(event._replace(send_ns=event.send_ns + late_ns, stamp_ns=stamp_ns))
    return iter(sorted(moved, key=lambda event: event.send_ns))


def assert_fixes_off_by(taken: list[Taken], off_ms: float) -> None:
    """Check that fixes are wrong by this much: the bench's receivers measure 20, 120, … ms after the start of the
    schedule."""
    fixes = [each.frame.gnss for each in taken if each.at_s > 1.5 and each.frame.gnss is not None]
    sweeps = [each.frame.t_ns for each in taken if each.at_s > 1.5 and each.frame.sweep is not None]
    assert len(fixes) > 10
    phase_ms = (fixes[-1].t_ns - sweeps[-1]) / 1e6 % 100.0
    assert (phase_ms - off_ms - 20.0 + 50.0) % 100.0 - 50.0 == pytest.approx(0.0, abs=7.0)
