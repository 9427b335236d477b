"""A VLP-16 on the network: decodes data packets to sweeps, and reads the clock's reference from position packets."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from pipeline.formats.velodyne import OUT_OF_ORDER, BadPacket, VelodyneDecoder, read_packet, read_position
from pipeline.sources.live.clock import HostClock
from pipeline.sources.live.config import LidarConfig
from pipeline.sources.live.devices.device_reader import POLL_S, ReadDevice, Reader
from pipeline.sources.live.devices.sender_pin import BesidePin, SenderPin
from pipeline.sources.live.devices.sensor_input import Deliver, whole_hours_off
from pipeline.sources.live.devices.udp import read_datagrams
from pipeline.sources.live.health import StreamStats
from pipeline.types import Sweep

_SILENT_S = 1.0
"""A VLP-16 sends 754 packets a second; the stream's health calls it silent after the same time."""
_LOOK_EVERY, _MIXED_SHARE = 512, 0.3
"""If this share of this many packets is inconsistent with the others, another sensor is sending as well, since that
sends as many packets. A sensor whose clock was set costs one packet, a bad network less than one in a thousand."""


class LidarInput:
    """pps: state of the pulse per second in the last position packet; None before the first. follows_gps: the sensor's
    time is UTC past the hour. T_ego_lidar: (4, 4), its mount. offset_ns: added to its timestamps. on_packet: receives
    each data packet and its arrival time."""

    def __init__(self, config: LidarConfig, clock: HostClock, deliver: Deliver[Sweep]) -> None:
        self.stats = StreamStats("lidar")
        self.stats.note = f"no data on UDP port {config.data_port} yet"
        self.pps: str | None = None
        self.follows_gps = False
        self._clock, self._deliver = clock, deliver
        self.offset_ns = round(config.time_offset_ms * 1e6)
        self.T_ego_lidar = config.mount.T_ego_sensor()
        self.on_packet: Callable[[bytes, int], object] | None = None
        self._decoder = VelodyneDecoder(self.T_ego_lidar)
        self.stats.refused = self._decoder.counts.refused  # counts of the decoder; those of the position port are added
        self._pin = SenderPin("LiDAR", config.sender, _is_data, self.stats.refused, by_port=True, silent_s=_SILENT_S)
        self._looked, self._misfits, self._mixed = 0, 0, False
        self.stats.remarks = (self._pin.said, self._about_mixture, self._about_clock)
        self.stats.warnings = (self._pin.others, self._about_mixture)
        listen = partial(read_datagrams, interface=config.interface, group=config.multicast_group)
        listeners = [("lidar", partial(listen, config.data_port, receive=self.receive, pin=self._pin))]
        if config.position_port is not None:
            beside = BesidePin(self._pin, config.sender)
            positions = partial(listen, config.position_port, receive=self.receive_position, pin=beside)
            listeners.append(("lidar-position", positions))
        self.readers: tuple[Reader, ...] = tuple(
            Reader(name, _until_stopped(read), self._say, POLL_S) for name, read in listeners
        )

    def clock_offset_ms(self) -> float | None:
        offset_ns = self._decoder.clock.offset_ns
        return None if offset_ns is None else whole_hours_off(offset_ns)

    def utc_to_host_ns(self, utc_ns: int, near_ns: int) -> int | None:
        """Converts UTC to the host's timeline by the LiDAR's clock; None if that does not follow GPS."""
        offset_ns = self._decoder.clock.offset_ns
        if not self.follows_gps or offset_ns is None:
            return None
        return near_ns + round(whole_hours_off(utc_ns + offset_ns - near_ns) * 1e6)

    def receive(self, packet: bytes, wall_ns: int) -> None:
        """Take a data packet, received at ``wall_ns`` of the system's clock. The decoder's clock is mapped to the
        host's timeline; GPS is not used there, because its time is not the host's."""
        arrived_ns = self._clock.of_wall_ns(wall_ns)
        on_packet = self.on_packet
        if on_packet is not None:
            on_packet(packet, arrived_ns)
        sweep = self._decoder.push(packet, arrived_ns)
        counts = self._decoder.counts
        self.stats.lost = counts.lost
        if counts.packets - self._looked >= _LOOK_EVERY:
            misfits = counts.refused[OUT_OF_ORDER]
            self._mixed = misfits - self._misfits > _MIXED_SHARE * (counts.packets - self._looked)
            self._looked, self._misfits = counts.packets, misfits
        if counts.models and self.stats.since_ns(arrived_ns) is None:
            self.stats.note = f"packets of a {', '.join(counts.models)}, not of a VLP-16"
        if sweep is not None:
            self.stats.note = ""
            t_ns = sweep.t_ns + self.offset_ns
            self.stats.arrived(arrived_ns, t_ns)
            self._deliver(t_ns, sweep, arrived_ns)

    def receive_position(self, packet: bytes, wall_ns: int) -> None:
        """Take a position packet."""
        try:
            position = read_position(packet)
        except BadPacket as bad:
            self.stats.refused[f"{bad.reason} on the position port"] += 1
            return
        self.pps, self.follows_gps = position.pps, position.locked

    def _about_mixture(self) -> str:
        return "many packets do not match the others: does a second LiDAR have the same address?" if self._mixed else ""

    def _about_clock(self) -> str:
        """Problems with the timestamps of its packets."""
        if self._mixed:
            return ""
        jumps, last_s = self._decoder.counts.jumps, self._decoder.counts.jump_s
        often = "once" if jumps == 1 else f"{jumps} times, last"
        return f"its clock jumped {often} by {last_s:+.3f} s" if jumps else ""

    def _say(self, text: str) -> None:
        self.stats.note = text


def _is_data(data: bytes) -> bool:
    try:
        read_packet(data)
    except BadPacket:
        return False
    return True


def _until_stopped(read: Callable[..., None]) -> ReadDevice:
    """Adapts a read function that takes ``stop`` as its last argument."""
    return lambda stop: read(stop=stop)
