"""ROS messages of Velodyne packets (package velodyne_msgs), which neither ROS's own definitions nor the library that
reads bags include. Sessions use them among their schemas; the library is imported when a message is read or written."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

PACKET, SCAN = "velodyne_msgs/msg/VelodynePacket", "velodyne_msgs/msg/VelodyneScan"
PACKET_DEFINITION = "builtin_interfaces/Time stamp\nuint8[1206] data\n"
SCAN_DEFINITION = "std_msgs/Header header\nvelodyne_msgs/VelodynePacket[] packets\n"


@cache
def typestore() -> Typestore:
    """ROS 2's own messages and these."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(PACKET_DEFINITION, PACKET) | get_types_from_msg(SCAN_DEFINITION, SCAN))
    return store
