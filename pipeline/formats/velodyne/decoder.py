"""Velodyne packets → sweeps: checked and cut into rotations by ``cutter``, decoded by velodyne-decoder."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.formats.velodyne import packet
from pipeline.formats.velodyne.clock import SensorClock
from pipeline.formats.velodyne.cutter import DecoderCounts, Rotation, RotationCutter
from pipeline.formats.velodyne.models import VLP16, VelodyneModel
from pipeline.formats.velodyne.packet import HOUR_US
from pipeline.types import F32, F64, U8, Sweep

MIN_RANGE_M, MAX_RANGE_M = 0.1, 200.0
_X, _TIME, _RING = 0, 4, 6


class VelodyneDecoder:
    """One sensor's stream. T_ego_lidar: (4, 4), where the sensor sits; by default the ego frame is the sensor's own.
    model: which sensor; packets of others are refused."""

    def __init__(
        self,
        T_ego_lidar: F64 | None = None,
        clock: SensorClock | None = None,
        keeps_partial: bool = False,
        model: VelodyneModel = VLP16,
    ) -> None:
        T = np.eye(4) if T_ego_lidar is None else np.asarray(T_ego_lidar, dtype=np.float64)
        self.clock = clock or SensorClock()
        self._cutter = RotationCutter(T, self.clock, keeps_partial, model)
        self._R, self._origin = T[:3, :3].astype(np.float32), T[:3, 3].astype(np.float32)
        self._mount: tuple[float, float, float] = (float(T[0, 3]), float(T[1, 3]), float(T[2, 3]))
        self._is_moved = not np.array_equal(T, np.eye(4))
        _warm_up()
        from velodyne_decoder import Config, Model, ScanDecoder  # 0.1 s to import: only who has packets pays

        self._channels = model.channels
        self._library = ScanDecoder(
            Config(model=getattr(Model, model.library), min_range=MIN_RANGE_M, max_range=MAX_RANGE_M)
        )

    @property
    def counts(self) -> DecoderCounts:
        return self._cutter.counts

    def push(self, data: bytes, t_host_ns: int | None = None) -> Sweep | None:
        """Take one data packet; the sweep that it completes, if it is the first of the next rotation.

        t_host_ns: when it was received (or, in a file, captured); None where nobody knows. Never raises: what is no
        packet of the sensor is refused and counted by reason.
        """
        rotation = self._cutter.push(data, t_host_ns)
        return self._decode(rotation) if rotation is not None else None

    def flush(self) -> Sweep | None:
        """The sweep under way at the end of a stream, if it is whole. The next packet starts anew."""
        rotation = self._cutter.flush()
        return self._decode(rotation) if rotation is not None else None

    def _decode(self, rotation: Rotation) -> Sweep | None:
        """The sweep of a rotation; None when it holds no return."""
        from velodyne_decoder import PacketVector, VelodynePacket

        packets = rotation.packets
        base_us = packets[0].time_us // HOUR_US * HOUR_US
        vector = PacketVector([VelodynePacket((it.time_us - base_us) * 1e-6, list(it.data)) for it in packets])
        _, cloud = self._library.decode(vector)
        points, ring, time_s = _columns(cloud, np.float32((packets[-1].time_us - rotation.ahead_us) * 1e-6))
        if not len(points):
            return None
        self.counts.sweeps += 1
        if self._is_moved:
            points[:, :3] = points[:, :3] @ self._R.T + self._origin
        return Sweep(rotation.t_ns, points, ring, self._channels, time_s, self._mount)


def _warm_up() -> None:
    """Compile before the first packet: no sensor waits for a compiler."""
    packet.warm_up()
    _columns(np.empty((0, 8), dtype=np.float32), np.float32(0.0))


@numba.njit(cache=True, nogil=True)
def _columns(cloud: F32, later_s: np.float32) -> tuple[F32, U8, F32]:  # pragma: no cover
    """(N, 4) x y z intensity, (N,) ring and (N,) seconds, shifted by ``later_s``, of the returns that are finite. One
    pass instead of one for each column."""
    points = np.empty((len(cloud), 4), dtype=np.float32)
    ring = np.empty(len(cloud), dtype=np.uint8)
    time_s = np.empty(len(cloud), dtype=np.float32)
    n = 0
    for row in range(len(cloud)):
        if np.isfinite(cloud[row, _X]):
            for column in range(4):
                points[n, column] = cloud[row, column]
            ring[n] = cloud[row, _RING]
            time_s[n] = cloud[row, _TIME] + later_s
            n += 1
    return points[:n], ring[:n], time_s[:n]
