"""VLP-16 packets as a Velodyne sends them over UDP: validated, ordered, cut into sweeps and decoded."""

from __future__ import annotations

from pipeline.formats.velodyne.clock import SensorClock
from pipeline.formats.velodyne.cutter import OUT_OF_ORDER, DecoderCounts, Rotation, RotationCutter, say_refused
from pipeline.formats.velodyne.decoder import Vlp16Decoder
from pipeline.formats.velodyne.packet import PACKET_BYTES, BadPacket, Packet, read_packet
from pipeline.formats.velodyne.position import POSITION_BYTES, Position, read_position

__all__ = [
    "OUT_OF_ORDER",
    "PACKET_BYTES",
    "POSITION_BYTES",
    "BadPacket",
    "DecoderCounts",
    "Packet",
    "Position",
    "Rotation",
    "RotationCutter",
    "SensorClock",
    "Vlp16Decoder",
    "read_packet",
    "read_position",
    "say_refused",
]
