"""Raw LiDAR packets as ``velodyne_msgs/VelodyneScan``: what ROS's Velodyne driver records, and many programs read."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pipeline.recording.messages import Damaged
from pipeline.recording.topics import VELODYNE_PACKET_DEFINITION, VELODYNE_SCAN, VELODYNE_SCAN_DEFINITION

PACKET_BYTES = 1206
_PACKET, _HEADER, _TIME = "velodyne_msgs/msg/VelodynePacket", "std_msgs/msg/Header", "builtin_interfaces/msg/Time"


def scan_message(packets: list[tuple[int, bytes]]) -> bytes:
    """CDR of (when received in ns, payload) each, oldest first. Payloads of another length than a VLP-16's are left
    out: the message has no room for them."""
    types = _store().types
    stamp, header, packet = types[_TIME], types[_HEADER], types[_PACKET]
    whole = [(t_ns, payload) for t_ns, payload in packets if len(payload) == PACKET_BYTES]
    first_ns = packets[0][0] if packets else 0
    message = types[VELODYNE_SCAN](
        header(stamp(*divmod(first_ns, 1_000_000_000)), "lidar"),
        [packet(stamp(*divmod(t_ns, 1_000_000_000)), np.frombuffer(data, dtype=np.uint8)) for t_ns, data in whole],
    )
    return bytes(_store().serialize_cdr(message, VELODYNE_SCAN))


def packets_from(data: bytes) -> list[tuple[int, bytes]]:
    """Back from ``scan_message``. Damaged when it is none."""
    try:
        scan: Any = _store().deserialize_cdr(data, VELODYNE_SCAN)
    except Exception as error:  # damaged bytes make the library raise whatever they like
        raise Damaged(f"a message of /lidar/packets cannot be read: {error}") from None
    return [(each.stamp.sec * 1_000_000_000 + each.stamp.nanosec, each.data.tobytes()) for each in scan.packets]


@cache
def _store() -> Any:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(VELODYNE_PACKET_DEFINITION, _PACKET))
    store.register(get_types_from_msg(VELODYNE_SCAN_DEFINITION, VELODYNE_SCAN))
    return store
