"""Shared by the inputs of all kinds of sensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from pipeline.sources.live.devices.device_reader import Reader
from pipeline.sources.live.health import StreamStats

T = TypeVar("T")

Deliver = Callable[[int, T, int], None]
"""Takes measurement time, message, and arrival time; both times on the host's timeline."""


class Input(Protocol):
    """One sensor: its reader threads and their counters."""

    stats: StreamStats
    readers: tuple[Reader, ...]

    def clock_offset_ms(self) -> float | None:
        """Host time minus the sensor's own (for a VLP-16: past the hour), including the shortest transmission delay;
        None if the sensor has no clock."""
        ...


def whole_hours_off(offset_ns: int) -> float:
    """An offset between a clock and one that restarts every hour: milliseconds, at most half an hour either way."""
    hour_ns = 3_600_000_000_000
    return ((offset_ns + hour_ns // 2) % hour_ns - hour_ns // 2) / 1e6
