"""Encodes a sweep as the packets that a VLP-16 would have sent: for tests of the decoder, for the benchmark when no
real packets are available, and to replay a recording of point clouds over the network."""

from __future__ import annotations

import numpy as np

from pipeline.common.geometry import inverse, transform
from pipeline.formats.velodyne.models import PACKET_BYTES
from pipeline.formats.velodyne.packet import BLOCK_US, HOUR_US
from pipeline.types import F64, Sweep

PACKETS_A_ROTATION = 75
"""At 603 rpm; one more would reach into the next rotation of a 10 Hz recording."""
_BLOCKS = 12
_FIRING_US = BLOCK_US / 2
_LASER_US = 2.304
_ROTATION_US = PACKETS_A_ROTATION * _BLOCKS * BLOCK_US
_RANGE_STEP_M = 0.002
_BLOCK = np.dtype([("flag", "<u2"), ("azimuth", "<u2"), ("returns", [("range", "<u2"), ("intensity", "u1")], (2, 16))])
_RING_OF_LASER = np.array([laser // 2 + 8 * (laser % 2) for laser in range(16)])
_LASER_OF_RING = np.argsort(_RING_OF_LASER)


def packets_of(sweep: Sweep, T_ego_lidar: F64 | None = None, ahead_us: int | None = None) -> list[bytes]:
    """75 single-return packets, strongest return, of one rotation that begins behind the car.

    Each point goes to the firing whose azimuth is nearest (0.2° apart) and keeps its range to 2 mm; of two points in
    one place the nearer stays. ahead_us: the sensor's own time when the head looks ahead; by default ``t_ns`` past the
    hour. T_ego_lidar: (4, 4), where the sensor sits. IndexError when the sweep has more rings than a VLP-16.
    """
    points = sweep.points[:, :3].astype(np.float64)
    if T_ego_lidar is not None:
        points = transform(inverse(T_ego_lidar), points)
    laser = _LASER_OF_RING[sweep.ring]
    range_m = np.linalg.norm(points, axis=1)
    azimuth_rad = np.arctan2(-points[:, 1], points[:, 0])  # clockwise from straight ahead
    since_us = (azimuth_rad / (2.0 * np.pi) + 0.5) * _ROTATION_US - laser * _LASER_US
    firings = PACKETS_A_ROTATION * _BLOCKS * 2
    firing = np.clip(np.rint(since_us / _FIRING_US), 0, firings - 1).astype(np.intp)
    blocks = np.zeros((PACKETS_A_ROTATION, _BLOCKS), dtype=_BLOCK)
    starts_us = np.arange(PACKETS_A_ROTATION * _BLOCKS) * BLOCK_US
    blocks["flag"] = 0xEEFF
    blocks["azimuth"] = (np.rint(starts_us / _ROTATION_US * 36_000) + 18_000).reshape(blocks.shape) % 36_000
    returns = blocks["returns"].reshape(firings, 16)
    far_first = np.argsort(-range_m, kind="stable")
    at = firing[far_first], laser[far_first]
    returns["range"][at] = np.clip(np.rint(range_m[far_first] / _RANGE_STEP_M), 0, 65_535)
    returns["intensity"][at] = np.clip(np.rint(sweep.points[far_first, 3]), 0, 255)
    blocks["returns"] = returns.reshape(blocks["returns"].shape)
    ahead = sweep.t_ns // 1000 if ahead_us is None else ahead_us
    stamps = (np.rint(ahead - _ROTATION_US / 2 + starts_us[::_BLOCKS]).astype(np.int64) % HOUR_US).astype("<u4")
    tail = b"\x37\x22"
    packets = [block.tobytes() + stamp.tobytes() + tail for block, stamp in zip(blocks, stamps, strict=True)]
    assert all(len(packet) == PACKET_BYTES for packet in packets)
    return packets
