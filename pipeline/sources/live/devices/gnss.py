"""Reads the sentences of a GNSS receiver over a serial line, TCP or UDP."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable
from dataclasses import replace

import serial

from pipeline.formats.nmea import BadSentence, NmeaReader, parse_sentence
from pipeline.sources.live.clock import FollowedClock, HostClock
from pipeline.sources.live.config import GnssConfig
from pipeline.sources.live.devices.device_reader import (
    CONNECT_S,
    NAME_S,
    POLL_S,
    DeviceLost,
    ReadDevice,
    Reader,
    ReaderStop,
)
from pipeline.sources.live.devices.rate_limit import RateLimit
from pipeline.sources.live.devices.sender_pin import SenderPin
from pipeline.sources.live.devices.sensor_input import Deliver
from pipeline.sources.live.devices.udp import read_datagrams
from pipeline.sources.live.health import StreamStats
from pipeline.types import GnssFix

_SILENT_POLLS = 10
"""Polls of a TCP connection without data, two seconds, before it is reopened; receivers send once a second."""
_LONGEST = 4096
_MOST_LINES = 8
_MOST_BYTES_S = 100_000
"""More than a serial line at 921,600 baud carries; a receiver that sends ten sentences 20 times a second sends a sixth
of it."""
_SILENT_S = 3.0
"""Three periods of a receiver that sends once a second, as in the stream's health."""


class GnssInput:
    """utc_to_host_ns: a better conversion from UTC to the host's timeline than this receiver's delays, if available: a
    LiDAR that follows GPS."""

    def __init__(
        self,
        config: GnssConfig,
        clock: HostClock,
        deliver: Deliver[GnssFix],
        utc_to_host_ns: Callable[[int, int], int | None] = lambda utc_ns, near_ns: None,
    ) -> None:
        self.stats = StreamStats("gnss")
        if config.udp_port is not None:
            self.stats.note = f"no data on UDP port {config.udp_port} yet"
        self._clock, self._deliver, self._utc_to_host_ns = clock, deliver, utc_to_host_ns
        self._offset_ns = round(config.time_offset_ms * 1e6)
        self._own = FollowedClock()
        self._sentences = NmeaReader()
        self._has_fix: bool | None = None
        self._rest = b""
        self._limit = RateLimit(_MOST_BYTES_S)
        self._pin = SenderPin(
            "receiver", config.sender, _is_nmea, self.stats.refused, by_port=False, silent_s=_SILENT_S
        )
        self.stats.remarks = (self._pin.said, self._about_clock)
        self.stats.warnings = (self._pin.others,)
        self.readers: tuple[Reader, ...] = (Reader("gnss", self._read(config), self._say, _worst_s(config)),)

    def clock_offset_ms(self) -> float | None:
        return self._own.offset_ms

    def _read(self, config: GnssConfig) -> ReadDevice:
        if config.udp_port is not None:
            port, interface = config.udp_port, config.interface
            return lambda stop: read_datagrams(port, interface, None, self.receive, self._pin, stop)
        if config.tcp is not None:
            host, _, number = config.tcp.rpartition(":")
            return lambda stop: _read_tcp(host, int(number), self._bytes, stop)
        device = config.serial or ""
        return lambda stop: _read_serial(device, config.baud, self._bytes, stop)

    def receive(self, data: bytes, wall_ns: int) -> None:
        """Take a datagram of complete sentences, received at ``wall_ns`` of the system's clock."""
        self._check_rate(data)
        self._lines(data.splitlines(), self._clock.of_wall_ns(wall_ns))

    def _bytes(self, data: bytes) -> None:
        """Part of a stream: complete lines are processed, the rest is buffered; if it grows too long, it is garbage."""
        self._check_rate(data)
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest if len(rest) < _LONGEST else b""
        self._lines(lines, self._clock.now_ns())

    def _check_rate(self, data: bytes) -> None:
        """DeviceLost if no receiver sends that much."""
        if not self._limit.allows(len(data)):
            self._rest = b""
            raise DeviceLost(f"sends more than {_MOST_BYTES_S // 1000} kB a second: not a GNSS receiver")

    def _lines(self, lines: list[bytes], arrived_ns: int) -> None:
        before = self._sentences.no_fix
        for line in lines:
            if not line.strip():
                continue
            utc_near_ns = arrived_ns + self._clock.ahead_ns()
            fix = self._sentences.push(line.decode("ascii", errors="replace"), utc_near_ns)
            self.stats.lost = self._sentences.bad
            if fix is not None:
                self._has_fix = True
                self._give(fix, arrived_ns)
            elif self._sentences.no_fix > before:
                self._has_fix = False
            before = self._sentences.no_fix
        self.stats.note = "" if self._has_fix is not False else self._without_fix(arrived_ns)

    def _without_fix(self, arrived_ns: int) -> str:
        """A message if the receiver sends data but has no fix."""
        return "no fix yet" if self.stats.since_ns(arrived_ns) is None else "no fix: the receiver has lost its position"

    def _give(self, fix: GnssFix, arrived_ns: int) -> None:
        own_ns, by_lidar_ns = self._own.to_host_ns(fix.t_ns, arrived_ns), self._utc_to_host_ns(fix.t_ns, arrived_ns)
        t_ns = (own_ns if by_lidar_ns is None else by_lidar_ns) + self._offset_ns
        self.stats.arrived(arrived_ns, t_ns)
        self._deliver(t_ns, replace(fix, t_ns=t_ns), arrived_ns)

    def _about_clock(self) -> str:
        times = self._own.jumps
        return f"its clock was set {times} {'time' if times == 1 else 'times'}" if times else ""

    def _say(self, text: str) -> None:
        self.stats.note = text


def _worst_s(config: GnssConfig) -> float:
    """How long its reader may go without a check: a poll, or until a connection is there."""
    return NAME_S + CONNECT_S if config.tcp is not None else POLL_S


def _is_nmea(data: bytes) -> bool:
    """Whether the data contains a valid sentence of a receiver."""
    for line in data.splitlines()[:_MOST_LINES]:
        with contextlib.suppress(BadSentence):
            parse_sentence(line.decode("ascii", errors="replace"))
            return True
    return False


def _read_tcp(host: str, port: int, receive: Callable[[bytes], None], stop: ReaderStop) -> None:
    try:
        connection = socket.create_connection((host, port), timeout=CONNECT_S)
    except (OSError, OverflowError) as error:
        raise DeviceLost(f"{host}:{port}: {getattr(error, 'strerror', None) or error}") from None
    silent = 0
    with connection:
        connection.settimeout(POLL_S)
        while not stop and silent < _SILENT_POLLS:
            silent += 1
            with contextlib.suppress(TimeoutError):
                data = connection.recv(_LONGEST)
                if not data:
                    raise DeviceLost(f"{host}:{port}: the receiver closed the connection")
                silent = 0
                receive(data)


def _read_serial(device: str, baud: int, receive: Callable[[bytes], None], stop: ReaderStop) -> None:
    try:
        with serial.Serial(device, baud, timeout=POLL_S) as line:
            while not stop:
                receive(line.read(max(1, line.in_waiting)))
    except (serial.SerialException, OSError, ValueError) as error:
        number = getattr(error, "errno", None)
        raise DeviceLost(f"{device}: {os.strerror(number) if number else error}") from None
