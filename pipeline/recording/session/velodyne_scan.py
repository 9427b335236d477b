"""Raw LiDAR packets as ``velodyne_msgs/VelodyneScan``, which ROS's Velodyne driver records and many programs read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.formats.file_reading import rigid_transform
from pipeline.formats.velodyne import PACKET_BYTES, VelodyneDecoder, model_of
from pipeline.formats.velodyne.ros import PACKET, SCAN, typestore
from pipeline.recording.errors import Damaged
from pipeline.recording.mcap.reader import McapFile
from pipeline.recording.session.frame_record import PacketsRef
from pipeline.recording.topics import PACKETS
from pipeline.types import F64, Sweep
from pipeline.types.source import SourceError

_USUALLY_BEFORE_NS, PACKETS_BEFORE_NS, _PACKETS_AFTER_NS = 800_000_000, 4_000_000_000, 200_000_000
"""How long before the tick the packets of its sweep are usually received, and at most: a tick is stored when the
pipeline has processed it, which on a busy machine is late. The last is how long after the tick they may have been
written."""
_SAME_SWEEP_NS = 40_000_000
"""Timestamps of a sweep decoded with and without much earlier packets differ by far less; sweeps are 100 ms apart."""
_HEADER, _TIME = "std_msgs/msg/Header", "builtin_interfaces/msg/Time"


@dataclass(frozen=True)
class RawLidar:
    """What is needed to decode sweeps from a sensor's packets."""

    T_ego_lidar: F64
    """(4, 4), the sensor's mount."""
    offset_ns: int = 0
    """Added to its timestamps."""

    def reference(self, sweep: Sweep) -> PacketsRef:
        """The tick's reference to a sweep that is not stored itself."""
        return PacketsRef(sweep.t_ns, self.offset_ns, tuple(float(value) for value in self.T_ego_lidar.ravel()))


def sweep_of_packets(ref: PacketsRef, at_ns: int, file: McapFile) -> Sweep:
    """The sweep of a tick stored at log time ``at_ns``, decoded from its packets. Damaged if they are missing."""
    try:
        mount = rigid_transform(np.reshape(ref.T_ego_lidar, (4, 4)), "T_ego_lidar")
    except (SourceError, ValueError):
        raise Damaged("the LiDAR's mount cannot be read") from None
    wanted_ns = ref.t_ns - ref.offset_ns
    for before_ns in (_USUALLY_BEFORE_NS, PACKETS_BEFORE_NS):
        sweeps = _sweeps(mount, file, at_ns - before_ns, at_ns + _PACKETS_AFTER_NS)
        near = [each for each in sweeps if abs(each.t_ns - wanted_ns) < _SAME_SWEEP_NS]
        if near:
            return replace(min(near, key=lambda each: abs(each.t_ns - wanted_ns)), t_ns=ref.t_ns)
    raise Damaged("the session lacks the packets of this sweep")


def _sweeps(mount: F64, file: McapFile, from_ns: int, to_ns: int) -> list[Sweep]:
    """Sweeps from the packets stored between two log times. mount: T_ego_lidar."""
    scans = file.messages((PACKETS,), from_ns, to_ns)
    packets = [packet for stored in scans for packet in packets_from(stored.data)]
    decoder = VelodyneDecoder(mount, model=model_of(payload for _, payload in packets))
    sweeps = [decoder.push(payload, t_ns) for t_ns, payload in packets] + [decoder.flush()]
    return [each for each in sweeps if each is not None]


def scan_message(packets: list[tuple[int, bytes]]) -> bytes:
    """CDR of (receive time in ns, payload) each, oldest first. Payloads without the length of a Velodyne packet are
    left out, since the message type cannot contain them."""
    types = typestore().types
    stamp, header, packet = types[_TIME], types[_HEADER], types[PACKET]
    whole = [(t_ns, payload) for t_ns, payload in packets if len(payload) == PACKET_BYTES]
    first_ns = packets[0][0] if packets else 0
    message = types[SCAN](
        header(stamp(*divmod(first_ns, 1_000_000_000)), "lidar"),
        [packet(stamp(*divmod(t_ns, 1_000_000_000)), np.frombuffer(data, dtype=np.uint8)) for t_ns, data in whole],
    )
    return bytes(typestore().serialize_cdr(message, SCAN))


def packets_from(data: bytes) -> list[tuple[int, bytes]]:
    """Inverse of ``scan_message``. Damaged if it is invalid."""
    try:
        scan: Any = typestore().deserialize_cdr(data, SCAN)
    except Exception as error:  # damaged bytes make the library raise arbitrary errors
        raise Damaged(f"a message of /lidar/packets cannot be read: {error}") from None
    return [(each.stamp.sec * 1_000_000_000 + each.stamp.nanosec, each.data.tobytes()) for each in scan.packets]
