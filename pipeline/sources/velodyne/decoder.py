"""VLP-16 packets → sweeps: checked and cut into rotations by ``cutter``, decoded by velodyne-decoder."""

from __future__ import annotations

import numpy as np
from velodyne_decoder import Config, Model, PacketVector, ScanDecoder, VelodynePacket

from pipeline.sources.velodyne.clock import SensorClock
from pipeline.sources.velodyne.cutter import DecoderCounts, Rotation, RotationCutter
from pipeline.sources.velodyne.packet import HOUR_US
from pipeline.types import F32, F64, Sweep

CHANNELS = 16
MIN_RANGE_M, MAX_RANGE_M = 0.1, 200.0
_X, _INTENSITY, _TIME, _RING = 0, 3, 4, 6


class Vlp16Decoder:
    """One sensor's stream. T_ego_lidar: (4, 4), where the sensor sits; by default the ego frame is the sensor's own."""

    def __init__(
        self, T_ego_lidar: F64 | None = None, clock: SensorClock | None = None, keeps_partial: bool = False
    ) -> None:
        T = np.eye(4) if T_ego_lidar is None else np.asarray(T_ego_lidar, dtype=np.float64)
        self.clock = clock or SensorClock()
        self._cutter = RotationCutter(T, self.clock, keeps_partial)
        self._R, self._origin = T[:3, :3].astype(np.float32), T[:3, 3].astype(np.float32)
        self._is_moved = not np.array_equal(T, np.eye(4))
        self._library = ScanDecoder(Config(model=Model.VLP16, min_range=MIN_RANGE_M, max_range=MAX_RANGE_M))

    @property
    def counts(self) -> DecoderCounts:
        return self._cutter.counts

    def push(self, packet: bytes, t_host_ns: int | None = None) -> Sweep | None:
        """Take one data packet; the sweep that it completes, if it is the first of the next rotation.

        t_host_ns: when it was received (or, in a file, captured); null where nobody knows. Never raises: what is no
        packet of a VLP-16 is refused and counted by reason.
        """
        return self._decode(self._cutter.push(packet, t_host_ns))

    def flush(self) -> Sweep | None:
        """The sweep under way at the end of a stream, if it is whole. The next packet starts anew."""
        return self._decode(self._cutter.flush())

    def _decode(self, rotation: Rotation | None) -> Sweep | None:
        """The sweep of a rotation; null when it holds no return."""
        if rotation is None:
            return None
        packets = rotation.packets
        base_us = packets[0].time_us // HOUR_US * HOUR_US
        vector = PacketVector([VelodynePacket((it.time_us - base_us) * 1e-6, list(it.packet.data)) for it in packets])
        _, cloud = self._library.decode(vector)
        finite = np.isfinite(cloud[:, _X])
        cloud = cloud if finite.all() else cloud[finite]
        if not len(cloud):
            return None
        self.counts.sweeps += 1
        time_s = cloud[:, _TIME] + np.float32((packets[-1].time_us - rotation.ahead_us) * 1e-6)
        ring = cloud[:, _RING].astype(np.uint8)
        return Sweep(rotation.t_ns, self._to_ego(cloud), ring, CHANNELS, time_s.astype(np.float32, copy=False))

    def _to_ego(self, cloud: F32) -> F32:
        points = np.ascontiguousarray(cloud[:, : _INTENSITY + 1])
        if self._is_moved:
            points[:, :3] = points[:, :3] @ self._R.T + self._origin
        return points
