"""Packets as a Velodyne sends them over UDP: validated, ordered, cut into sweeps and decoded."""

from __future__ import annotations

from pipeline.formats.velodyne.clock import SensorClock
from pipeline.formats.velodyne.cutter import OUT_OF_ORDER, DecoderCounts, Rotation, RotationCutter, say_refused
from pipeline.formats.velodyne.decoder import VelodyneDecoder
from pipeline.formats.velodyne.models import (
    MODELS,
    PACKET_BYTES,
    VLP16,
    VelodyneModel,
    about_other_models,
    about_supported_models,
    model_of,
)
from pipeline.formats.velodyne.packet import BadPacket, Packet, read_packet
from pipeline.formats.velodyne.position import POSITION_BYTES, Position, read_position

__all__ = [
    "MODELS",
    "OUT_OF_ORDER",
    "PACKET_BYTES",
    "POSITION_BYTES",
    "VLP16",
    "BadPacket",
    "DecoderCounts",
    "Packet",
    "Position",
    "Rotation",
    "RotationCutter",
    "SensorClock",
    "VelodyneDecoder",
    "VelodyneModel",
    "about_other_models",
    "about_supported_models",
    "model_of",
    "read_packet",
    "read_position",
    "say_refused",
]
