"""Converts messages to network data with send times: a sweep becomes 75 packets, each sent when its last laser has
fired."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from pipeline.formats.velodyne.encode import PACKETS_A_ROTATION, packets_of
from pipeline.formats.velodyne.models import PACKET_BYTES
from pipeline.formats.velodyne.packet import BLOCK_US
from pipeline.replay.messages import Message
from pipeline.sources.live.health import Sensor
from pipeline.types import F64, Sweep

_PACKET_NS = round(12 * BLOCK_US * 1000)
ROTATION_NS = PACKETS_A_ROTATION * _PACKET_NS
_AHEAD_NS = ROTATION_NS // 2 + 20_000_000
"""Events of a message are sent at most this much before its time; recordings may be out of order by as much."""


class WireEvent(NamedTuple):
    """One thing to send."""

    send_ns: int
    """When to send it, Unix time."""
    sensor: Sensor
    """Determines address and protocol."""
    stamp_ns: int
    """The sensor's own timestamp."""
    payload: Any
    """A packet without its timestamp, a JPEG, a ``GnssFix`` or an ``EgoState``; bytes for any other sensor are garbage
    and sent unchanged."""


def to_wire(
    messages: Iterable[Message], start_ns: int, speed: float = 1.0, T_ego_lidar: F64 | None = None
) -> Iterator[WireEvent]:
    """Events in order of time, the first at ``start_ns``. At a speed other than 1 the world runs faster or slower, but
    the sensors do not: the head rotates at its usual rate, and a sweep that overlaps another is left out."""
    waiting: list[tuple[int, int, WireEvent]] = []
    first_ns: int | None = None
    busy_until_ns, count = 0, 0
    for message in messages:
        first_ns = message.t_ns if first_ns is None else first_ns
        at_ns = start_ns + _AHEAD_NS + round((message.t_ns - first_ns) / speed)
        while waiting and waiting[0][0] <= at_ns - _AHEAD_NS:
            yield heapq.heappop(waiting)[2]
        if isinstance(message.value, Sweep):
            if at_ns - ROTATION_NS // 2 < busy_until_ns:
                continue
            busy_until_ns = at_ns + ROTATION_NS // 2
        for event in _events(message, at_ns, T_ego_lidar):
            heapq.heappush(waiting, (event.send_ns, count := count + 1, event))
    while waiting:
        yield heapq.heappop(waiting)[2]


def _own_stamp_ns(message: Message, at_ns: int) -> int:
    """A captured packet's own timestamp, which is independent of the host's clock; for all others the given time."""
    if message.sensor == "lidar" and isinstance(message.value, bytes) and len(message.value) == PACKET_BYTES:
        return int.from_bytes(message.value[-6:-2], "little") * 1000
    return at_ns


def _events(message: Message, at_ns: int, T_ego_lidar: F64 | None) -> Iterator[WireEvent]:
    if not isinstance(message.value, Sweep):
        yield WireEvent(at_ns, message.sensor, _own_stamp_ns(message, at_ns), message.value)
        return
    packets = packets_of(replace(message.value, t_ns=at_ns), T_ego_lidar)
    for number, packet in enumerate(packets):
        fired_ns = at_ns - ROTATION_NS // 2 + number * _PACKET_NS
        yield WireEvent(fired_ns + _PACKET_NS, "lidar", fired_ns, packet)
