"""Velodyne packets → rotations, packet by packet: each is validated and put in order; the cut is behind the car.

The view ahead is therefore never split, and the tick of a rotation is the moment when the head looks straight ahead. A
packet's position follows from its time and azimuth together: both must agree with the packets before it, so one corrupt
packet cannot cut a rotation short or shift its time.
"""

from __future__ import annotations

from bisect import bisect, insort
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np

from pipeline.formats.velodyne.clock import SensorClock
from pipeline.formats.velodyne.models import VLP16, VelodyneModel
from pipeline.formats.velodyne.packet import HOUR_US, ROTATION_CDEG, BadPacket, Packet, read_packet
from pipeline.types import F64

_CONTINUES_US = 100_000  # packets further apart do not tell how often the head went round
_SEEN_PASSING_US = 20_000  # packets nearer than this on both sides of the cut: what is missing lies behind the car
_PAUSE_AGREES_US = 50_000
_AZIMUTH_TOLERANCE_CDEG, _AZIMUTH_TOLERANCE_SHARE = 300.0, 0.02
_APART_SHARE = 0.5  # of a packet's span: nearer in time, two packets are one
_EDGE_CDEG = 3_600.0
_ENOUGH, _ENOUGH_AGAIN, _SETTLED_PACKETS = 2, 4, 7_540
"""A clock that jumped is believed after two packets that follow on each other; within ten seconds of a jump after four.
A clock is set once. Two sensors whose packets are mixed seem to jump all the time, and at one rate neither sends more
than two in a row."""
OUT_OF_ORDER = "time or azimuth out of order"


@dataclass
class DecoderCounts:
    """What came so far."""

    packets: int = 0
    """Received, refused ones included."""
    refused: Counter[str] = field(default_factory=Counter)
    """By reason."""
    models: Counter[str] = field(default_factory=Counter)
    """Packets of other Velodynes, by model."""
    lost: int = 0
    """Packets that the time between their neighbours says are missing."""
    sweeps: int = 0
    """Complete rotations given."""
    partial: int = 0
    """Rotations seen in part only (the first, the last, one cut by a pause), not given."""
    jumps: int = 0
    """How often the sensor's clock went back, or ahead by more than the time that had passed."""
    jump_s: float = 0.0
    """By how much, the last time."""

    def about_refused(self) -> str:
        """See ``say_refused``."""
        return say_refused(self.refused)


def say_refused(refused: Mapping[str, int]) -> str:
    """``3 packets refused: 2 all zero, 1 not 1206 bytes``, of packets by reason; empty when none was."""
    if not refused:
        return ""
    count = sum(refused.values())
    reasons = ", ".join(f"{count} {reason}" for reason, count in sorted(refused.items()))
    return f"{count} {'packet' if count == 1 else 'packets'} refused: {reasons}"


class TimedPacket(NamedTuple):
    """A packet on a clock that does not wrap at the hour, and on the circle that begins behind the car; the rest as in
    ``Packet``."""

    time_us: int
    """Counts on over the hours."""
    phase_cdeg: float
    """Hundredths of a degree, clockwise from straight behind."""
    rate_cdeg_us: float
    """How fast the head turns."""
    span_us: float
    """Time to the next packet."""
    data: bytes
    """All 1206 bytes."""
    t_host_ns: int | None
    """When it arrived, by this machine's clock; None from a file without one."""
    origin: int
    """Whatever its giver knows it by."""


class Rotation(NamedTuple):
    """One turn of the head."""

    packets: list[TimedPacket]
    """In order of time."""
    ahead_us: float
    """The sensor's time when its head looked straight ahead."""
    t_ns: int
    """The same by the stream's clock."""


class _Place(Enum):
    """Where a packet belongs: to the rotation under way, to the next one, to one after a gap in which nobody saw the
    head pass behind the car, or to a new beginning of the sensor's own time."""

    HERE, NEXT, AFTER_GAP, ANEW = range(4)


_HERE, _NEXT, _AFTER_GAP, _ANEW = _Place  # looking a member up in its class takes longer than all the rest


class RotationCutter:
    """One sensor's stream. T_ego_lidar: (4, 4), where the sensor sits, which says where behind is. keeps_partial: give
    rotations seen in part too. model: whose packets; those of others are refused."""

    def __init__(
        self, T_ego_lidar: F64, clock: SensorClock, keeps_partial: bool = False, model: VelodyneModel = VLP16
    ) -> None:
        self.model = model
        self.counts = DecoderCounts()
        self.clock = clock
        ahead = T_ego_lidar[:3, :3].T @ np.array([1.0, 0.0, 0.0])  # ego forward in the sensor's axes
        ahead_cdeg = -np.degrees(np.arctan2(ahead[1], ahead[0])) * 100.0  # azimuth runs clockwise
        self._behind_cdeg = float((ahead_cdeg + ROTATION_CDEG / 2) % ROTATION_CDEG)
        self._keeps_partial = keeps_partial
        self._packets: list[TimedPacket] = []  # in order of time
        self._began_at_cut = False
        self._reach_cdeg = (np.inf, np.inf)  # from where to where the rotation before was seen
        self._last: TimedPacket | None = None
        self._suspect: TimedPacket | None = None
        self._suspects = 0
        self._since_jump = _SETTLED_PACKETS

    def push(self, data: bytes, t_host_ns: int | None, origin: int = 0) -> Rotation | None:
        """Take one data packet; the rotation that it completes, if it is the first of the next. Never raises."""
        self.counts.packets += 1
        try:
            placed = self._placed(read_packet(data, self.model), t_host_ns, origin)
            place = self._accept(placed)
        except BadPacket as bad:
            self.counts.refused[bad.reason] += 1
            if bad.model is not None:
                self.counts.models[bad.model] += 1
            return None
        done = self._finish(place is _NEXT) if place is not _HERE else None
        self._since_jump += 1
        if place is _ANEW:
            self.clock.restart()
        if t_host_ns is not None:
            self.clock.observe(round(placed.time_us + placed.span_us), t_host_ns)
        packets = self._packets
        if not packets or placed.time_us > packets[-1].time_us:
            packets.append(placed)  # in order, as nearly all
        else:
            insort(packets, placed, key=_time_us)
        return done

    def flush(self) -> Rotation | None:
        """The rotation under way at the end of a stream, if it is whole. The next packet starts anew."""
        done = self._finish(False)
        self._last = self._suspect = None
        return done

    def _placed(self, packet: Packet, t_host_ns: int | None, origin: int) -> TimedPacket:
        """The packet in the hour that is nearest to when it must have been sent."""
        time_us, azimuth_cdeg, rate_cdeg_us, span_us, _, data = packet
        if self._last is not None:
            passed_us = (_host_gap_us(self._last, t_host_ns) or 0) + self._last.time_us
            hours = (passed_us - time_us) / HOUR_US
            if not -0.5 < hours < 0.5:
                time_us += round(hours) * HOUR_US
        phase_cdeg = (azimuth_cdeg - self._behind_cdeg) % ROTATION_CDEG
        return TimedPacket(time_us, phase_cdeg, rate_cdeg_us, span_us, data, t_host_ns, origin)

    def _accept(self, placed: TimedPacket) -> _Place:
        """Where the packet belongs. BadPacket when it does not fit to those before it.

        What does not fit is not believed at once: it becomes the beginning only when the next packet follows on it.
        """
        last, suspect = self._last, self._suspect
        self._suspect = None
        if last is None:
            self._last = placed
            return _HERE
        if self._is_doubled(placed):
            raise BadPacket("doubled")
        ahead_us = placed.time_us - last.time_us
        if 0 < ahead_us <= _CONTINUES_US and (turns := _turns(last, placed)) is not None:
            self._last = placed
            if turns == 0:
                return _HERE
            return _NEXT if ahead_us <= _SEEN_PASSING_US else _AFTER_GAP
        if -_CONTINUES_US <= ahead_us < 0 and _turns(placed, last) is not None:
            first = self._packets[0]
            if placed.time_us > first.time_us or _turns(placed, first) == 0:
                return _HERE
            raise BadPacket("late")
        host_gap_us = _host_gap_us(last, placed.t_host_ns)
        if host_gap_us is not None and ahead_us > _CONTINUES_US and abs(host_gap_us - ahead_us) < _PAUSE_AGREES_US:
            self._last = placed
            return _AFTER_GAP
        self._suspects = self._suspects + 1 if suspect is not None and _follows(suspect, placed) else 1
        if self._suspects >= (_ENOUGH if self._since_jump >= _SETTLED_PACKETS else _ENOUGH_AGAIN):
            self.counts.jumps += 1
            self.counts.jump_s = (ahead_us - (host_gap_us or 0)) / 1e6
            self._last, self._suspects, self._since_jump = placed, 0, 0
            return _ANEW
        self._suspect = placed
        raise BadPacket(OUT_OF_ORDER)

    def _is_doubled(self, placed: TimedPacket) -> bool:
        """Whether a packet of this time is there already; only some µs off, one of the two is spoiled."""
        apart_us = _APART_SHARE * placed.span_us
        if not self._packets or placed.time_us - self._packets[-1].time_us >= apart_us:
            return False  # in order, as nearly all
        at = bisect(self._packets, placed.time_us, key=_time_us)
        nearest = self._packets[max(0, at - 1) : at + 1]
        return any(abs(it.time_us - placed.time_us) < apart_us for it in nearest)

    def _finish(self, seen_passing: bool) -> Rotation | None:
        """The packets at hand, if they are a whole rotation: from cut to cut, or, of a sensor set to send a part of the
        circle only, as far round as the one before. seen_passing: the head was seen to pass behind the car at its end,
        and the next rotation begins there."""
        packets, self._packets = self._packets, []
        began_there, self._began_at_cut = self._began_at_cut, seen_passing
        if not packets:
            return None
        self.counts.lost += _missing(packets)
        first_cdeg, last_cdeg = packets[0].phase_cdeg, packets[-1].phase_cdeg
        begins = began_there or first_cdeg <= _EDGE_CDEG
        ends = seen_passing or last_cdeg >= ROTATION_CDEG - _EDGE_CDEG
        first_before, last_before = self._reach_cdeg
        again = abs(first_cdeg - first_before) <= _EDGE_CDEG and abs(last_cdeg - last_before) <= _EDGE_CDEG
        self._reach_cdeg = first_cdeg, last_cdeg
        if not (begins and ends) and not again:
            self.counts.partial += 1
            if not self._keeps_partial:
                return None
        ahead = min(packets, key=lambda placed: abs(placed.phase_cdeg - ROTATION_CDEG / 2))
        ahead_us = ahead.time_us + (ROTATION_CDEG / 2 - ahead.phase_cdeg) / ahead.rate_cdeg_us
        return Rotation(packets, ahead_us, self.clock.to_ns(ahead_us))


def _turns(earlier: TimedPacket, later: TimedPacket) -> int | None:
    """How often the head passed behind the car between two packets; None when their azimuths disagree with their
    times."""
    advance = (later.time_us - earlier.time_us) * later.rate_cdeg_us
    expected = earlier.phase_cdeg + advance
    turns = round((expected - later.phase_cdeg) / ROTATION_CDEG)
    off = abs(expected - later.phase_cdeg - turns * ROTATION_CDEG)
    return turns if off <= _AZIMUTH_TOLERANCE_CDEG + _AZIMUTH_TOLERANCE_SHARE * advance else None


def _follows(suspect: TimedPacket, placed: TimedPacket) -> bool:
    """Whether two packets that fit to nothing else fit to each other."""
    ahead_us = (placed.time_us - suspect.time_us + HOUR_US // 2) % HOUR_US - HOUR_US // 2
    moved = suspect._replace(time_us=placed.time_us - ahead_us)
    return 0 < ahead_us <= _CONTINUES_US and _turns(moved, placed) is not None


def _host_gap_us(last: TimedPacket, t_host_ns: int | None) -> int | None:
    """By the host's clock, how long after ``last`` a packet came; None when one of them has no host time."""
    return None if last.t_host_ns is None or t_host_ns is None else (t_host_ns - last.t_host_ns) // 1000


def _time_us(placed: TimedPacket) -> int:
    return placed.time_us


def _missing(packets: list[TimedPacket]) -> int:
    """Packets that must have been sent between those at hand."""
    span_us = packets[0].span_us
    gaps = np.diff([placed.time_us for placed in packets]) / span_us
    return int(np.maximum(np.rint(gaps) - 1, 0).sum())
