"""Packets → sweeps: order, cuts, time, and what must not spoil a sweep."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.geometry import inverse, rotation, transform
from pipeline.formats.velodyne import SensorClock, VelodyneDecoder
from pipeline.formats.velodyne.encode import PACKETS_A_ROTATION, packets_of
from pipeline.types import Sweep
from tests.pipeline.formats.velodyne.streams import (
    MODE,
    START_NS,
    STEP_NS,
    decoded,
    drive,
    ring_wall,
    stamped,
    time_us,
    with_byte,
)

STREAM = drive(4)
POINTS = len(ring_wall(0).points)


def ranges(sweep: Sweep) -> float:
    return float(np.median(np.linalg.norm(sweep.points[:, :3], axis=1)))


def test_sweeps_come_back_as_they_were() -> None:
    decoder = VelodyneDecoder()
    sweeps = decoded(decoder, STREAM)
    assert [round(ranges(sweep), 2) for sweep in sweeps] == [10.0, 9.9, 9.8, 9.7]
    for index, sweep in enumerate(sweeps):
        assert sweep.t_ns == pytest.approx(START_NS + index * STEP_NS, abs=2_000)
        assert len(sweep.points) == POINTS == len(sweep.ring)
        assert sweep.points.dtype == np.float32
        assert sweep.points.flags.c_contiguous
        assert np.array_equal(np.unique(sweep.ring), np.arange(16))
        elevation = np.degrees(np.arcsin(sweep.points[:, 2] / np.linalg.norm(sweep.points[:, :3], axis=1)))
        assert np.abs(elevation - (2.0 * sweep.ring - 15.0)).max() < 0.07  # lasers sit 11 mm apart
        assert np.array_equal(np.unique(sweep.points[:, 3]), 10.0 + np.arange(16))
    assert decoder.counts.sweeps == 4
    assert decoder.counts.lost == decoder.counts.partial == 0
    assert not decoder.counts.refused


def test_each_point_has_its_time() -> None:
    sweep = decoded(VelodyneDecoder(), STREAM)[1]
    assert sweep.time_s is not None
    assert sweep.time_s.dtype == np.float32
    azimuth = np.arctan2(-sweep.points[:, 1], sweep.points[:, 0])
    assert np.abs(sweep.time_s - azimuth / (2 * np.pi) * 0.0995328).max() < 60e-6


def test_cut_behind_the_mount_ahead() -> None:
    """The sensor is rotated by 90°: the view ahead of the car is in one sweep, and its tick is when the head points
    there."""
    T = np.eye(4)
    T[:3, :3] = rotation(0.0, 0.0, np.pi / 2)
    T[:3, 3] = (0.5, 0.0, 1.0)
    stream = [
        (packet, None) for i in range(3) for packet in packets_of(ring_wall(i * STEP_NS), None, 10**6 + i * 10**5)
    ]
    sweep = decoded(VelodyneDecoder(T), stream)[0]
    own = transform(inverse(T), sweep.points[:, :3].astype(np.float64))
    assert np.linalg.norm(own, axis=1) == pytest.approx(10.0, abs=0.01)
    assert sweep.time_s is not None
    ahead = np.abs(np.arctan2(sweep.points[:, 1], sweep.points[:, 0] - 0.5)) < np.radians(1.0)
    assert np.abs(sweep.time_s[ahead]).max() < 0.4e-3


SPOILED = {
    "all zero": bytes(1206),
    "empty": b"",
    "garbage": bytes(range(256)) * 5,
    "other model": with_byte(STREAM[100][0], 1205, 0x21),
    "far future": stamped(STREAM[100][0], time_us(STREAM[100][0]) + 10_000_000),
    "far past": stamped(STREAM[100][0], time_us(STREAM[100][0]) - 10_000_000),
    "a little off": stamped(STREAM[100][0], time_us(STREAM[100][0]) + 300),
    "half a turn off": stamped(STREAM[100][0], time_us(STREAM[100][0]) + 50_000),
    "no such mode": with_byte(STREAM[100][0], MODE, 0),
}


@pytest.mark.parametrize("name", SPOILED)
@pytest.mark.parametrize("at", [0, 1, 74, 75, 76, 100, 101, 299, 300])
def test_a_bad_packet_between_good_ones_changes_nothing(name: str, at: int) -> None:
    decoder = VelodyneDecoder()
    stream = [*STREAM[:at], (SPOILED[name], STREAM[min(at, 299)][1]), *STREAM[at:]]
    sweeps = decoded(decoder, stream)
    assert sum(decoder.counts.refused.values()) >= 1
    assert [round(ranges(sweep), 2) for sweep in sweeps] == [10.0, 9.9, 9.8, 9.7]
    for sweep in sweeps:
        assert len(sweep.points) >= POINTS * (1 - 1.1 / PACKETS_A_ROTATION)


def test_packets_out_of_order_and_doubled() -> None:
    order = list(range(len(STREAM)))
    for at in (3, 40, 90, 200):
        order[at : at + 4] = order[at : at + 4][::-1]
    order[120:120] = [119, 118]
    decoder = VelodyneDecoder()
    sweeps = decoded(decoder, [STREAM[i] for i in order])
    assert dict(decoder.counts.refused) == {"doubled": 2}
    for sweep, whole in zip(sweeps, decoded(VelodyneDecoder(), STREAM), strict=True):
        assert np.array_equal(sweep.points, whole.points)
        assert sweep.time_s is not None
        assert whole.time_s is not None
        assert np.array_equal(sweep.time_s, whole.time_s)


def test_a_packet_of_the_sweep_before_is_late() -> None:
    stream = [*STREAM[:74], *STREAM[75:80], STREAM[74], *STREAM[80:]]
    decoder = VelodyneDecoder()
    sweeps = decoded(decoder, stream)
    assert dict(decoder.counts.refused) == {"late": 1}
    assert len(sweeps) == 4
    assert len(sweeps[1].points) == POINTS


def test_lost_packets_are_counted() -> None:
    decoder = VelodyneDecoder()
    sweeps = decoded(decoder, [it for i, it in enumerate(STREAM) if i not in (90, 91, 92, 130)])
    assert decoder.counts.lost == 4
    assert [len(sweep.points) < POINTS for sweep in sweeps] == [False, True, False, False]


def test_lost_rotation_joins_no_two_sweeps() -> None:
    """From the middle of one rotation to the middle of the next but one, which the azimuth alone would not reveal."""
    sweeps = decoded(VelodyneDecoder(), [*STREAM[:40], *STREAM[40 + 75 :]])
    assert [round(ranges(sweep), 2) for sweep in sweeps] == [9.8, 9.7]


def test_begins_and_ends_anywhere() -> None:
    decoder = VelodyneDecoder()
    sweeps = decoded(decoder, STREAM[30:-30])
    assert [round(ranges(sweep), 2) for sweep in sweeps] == [9.9, 9.8]
    assert decoder.counts.partial == 2


@pytest.mark.parametrize("with_host", [True, False])
def test_a_sensor_set_to_send_the_front_half_only(with_host: bool) -> None:
    """The first rotation could be incomplete; from the second on, it is known that the sensor sends no more."""
    front = [(packet, t if with_host else None) for i, (packet, t) in enumerate(STREAM) if 19 <= i % 75 < 56]
    decoder = VelodyneDecoder()
    sweeps = decoded(decoder, front)
    assert [round(ranges(sweep), 2) for sweep in sweeps] == [9.9, 9.8, 9.7]
    assert not decoder.counts.refused
    for sweep in sweeps:
        assert len(sweep.points) == pytest.approx(POINTS * 37 / 75, rel=0.01)
        assert sweep.points[:, 0].min() > -0.5


@pytest.mark.parametrize("with_host", [True, False])
def test_silence(with_host: bool) -> None:
    """Unplugged for ten seconds in the middle of a sweep: no sweep joins the data before and after."""
    later = drive(2)
    stream = [(packet, t) for packet, t in STREAM[:190]]
    stream += [(stamped(packet, time_us(packet) + 10_000_000), t + 10_000_000_000) for packet, t in later]
    stream = [(packet, t if with_host else None) for packet, t in stream]
    sweeps = decoded(VelodyneDecoder(), stream)
    assert [round(ranges(sweep), 2) for sweep in sweeps] == [10.0, 9.9, 10.0, 9.9]


def test_sensor_that_starts_anew_keeps_the_hosts_time() -> None:
    """After switching off and on, the sensor counts from zero: times are right from its second packet on."""
    start = time_us(STREAM[0][0])
    again = [(stamped(packet, time_us(packet) - start), t + 2_000_000_000) for packet, t in STREAM]
    decoder = VelodyneDecoder()
    sweeps = decoded(decoder, STREAM + again)
    assert len(sweeps) == 8
    assert sweeps[-1].t_ns == pytest.approx(sweeps[3].t_ns + 2_000_000_000, abs=2_000)
    assert dict(decoder.counts.refused) == {"time or azimuth out of order": 1}


def test_hour_ends_within_a_sweep() -> None:
    start = time_us(STREAM[0][0])
    shifted = [(stamped(packet, (time_us(packet) - start + 3_599_850_000) % 3_600_000_000), t) for packet, t in STREAM]
    decoder = VelodyneDecoder()
    sweeps = decoded(decoder, shifted)
    assert np.diff([sweep.t_ns for sweep in sweeps]) == pytest.approx(STEP_NS, abs=2_000)
    assert len(sweeps) == 4
    assert not decoder.counts.refused
    for sweep in sweeps:
        assert sweep.time_s is not None
        assert np.abs(sweep.time_s).max() < 0.051


def test_same_stream_same_bytes() -> None:
    for one, other in zip(decoded(VelodyneDecoder(), STREAM), decoded(VelodyneDecoder(), STREAM), strict=True):
        assert one.points.tobytes() == other.points.tobytes()
        assert one.t_ns == other.t_ns


def test_no_host_time() -> None:
    decoder = VelodyneDecoder(clock=SensorClock())
    sweeps = decoded(decoder, [(packet, None) for packet, _ in STREAM])
    assert decoder.clock.reference == "sensor"
    assert sweeps[0].t_ns == pytest.approx(START_NS % 3_600_000_000_000, abs=2_000)


def test_counts_in_words() -> None:
    decoder = VelodyneDecoder()
    decoder.push(bytes(1206), None)
    decoder.push(bytes(1206), None)
    decoder.push(b"", None)
    assert decoder.counts.about_refused() == "3 packets refused: 2 all zero, 1 not 1206 bytes"
    assert VelodyneDecoder().counts.about_refused() == ""


def test_dual_return_gives_both_returns_once() -> None:
    """Two consecutive blocks contain the two returns of the same firings: both are kept for a wall behind a fence, one
    for a wall alone, where they are equal."""
    packets = [packet for index in range(3) for packet in dual_packets(index)]
    decoder = VelodyneDecoder()
    sweeps = decoded(decoder, [(packet, None) for packet in packets])
    assert len(sweeps) == 3
    assert not decoder.counts.refused
    assert decoder.counts.lost == 0
    for sweep in sweeps:
        range_m = np.linalg.norm(sweep.points[:, :3], axis=1)
        left, right = sweep.points[:, 1] > 0.5, sweep.points[:, 1] < -0.5
        assert np.abs(range_m[right] - 10.0).max() < 0.02
        near, far = np.abs(range_m[left] - 4.0) < 0.02, np.abs(range_m[left] - 10.0) < 0.02
        assert np.all(near | far)
        assert np.count_nonzero(near) == pytest.approx(np.count_nonzero(far), rel=0.1)
        assert np.count_nonzero(right) == pytest.approx(np.count_nonzero(far), rel=0.02)


def dual_packets(index: int) -> list[bytes]:
    """A wall at 10 m as the last return, a fence at 4 m to the left of the car as the strongest."""
    wall = packets_of(ring_wall(0), None, 10**6 + index * 10**5)
    fence = packets_of(ring_wall(0, 4.0), None, 10**6 + index * 10**5)
    dual = []
    for last, strongest in zip(wall, fence, strict=True):
        for half in range(2):
            blocks = b""
            for block in range(6 * half, 6 * half + 6):
                at = slice(100 * block, 100 * block + 100)
                azimuth = int.from_bytes(last[at][2:4], "little")
                blocks += last[at] + (strongest[at] if azimuth > 18_000 else last[at])
            dual.append(stamped(with_byte(blocks + last[1200:], MODE, 0x39), time_us(last) + round(half * 663.552)))
    return dual


def test_nothing_returned() -> None:
    """A covered sensor, or one in an empty field: sweeps without points are not delivered."""
    blank = Sweep(0, np.zeros((0, 4), np.float32), np.zeros(0, np.uint8), 16)
    assert (
        decoded(VelodyneDecoder(), [(packet, None) for i in range(2) for packet in packets_of(blank, None, i * 10**5)])
        == []
    )
