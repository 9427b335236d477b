"""The position packet that a VLP-16 sends besides its data (port 8308; Velodyne manual 63-9243, section 9.4): whether
it is synchronised to a GPS receiver, and the receiver's last sentence."""

from __future__ import annotations

from typing import NamedTuple

from pipeline.formats.velodyne.packet import HOUR_US, BadPacket

POSITION_BYTES = 512
_PPS = {0: "absent", 1: "synchronising", 2: "locked", 3: "error"}


class Position(NamedTuple):
    """What the packet says of the sensor's clock."""

    time_us: int
    """The sensor's, past the hour."""
    pps: str
    """State of the pulse per second."""
    nmea: str
    """The receiver's sentence as it came ($GPRMC or $GPGGA); empty without one."""
    locked: bool
    """Whether the sensor's time is UTC: pulses come, and there is a fix."""


def read_position(data: bytes) -> Position:
    """The packet's fields. BadPacket when it is none."""
    if len(data) != POSITION_BYTES:
        raise BadPacket(f"not {POSITION_BYTES} bytes")
    from velodyne_decoder import TelemetryPacket  # 0.1 s to import: only who has such packets pays

    try:
        telemetry = TelemetryPacket(list(data))
        pps, nmea = int(data[0xCA]), str(telemetry.nmea_sentence).strip()
        info = telemetry.parse_nmea() if nmea else None
    except (ValueError, TypeError, RuntimeError):
        raise BadPacket("not a position packet") from None
    if pps not in _PPS or telemetry.usec_since_toh >= HOUR_US:
        raise BadPacket("not a position packet")
    locked = pps == 2 and info is not None and bool(info.fix_available)
    return Position(int(telemetry.usec_since_toh), _PPS[pps], nmea, locked)
