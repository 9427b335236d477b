"""Reduces KITTI's 64-ring sweeps to 16 rings.

KITTI's files have no ring numbers, but they list ring after ring, the highest first, each counter-clockwise from
straight ahead: the azimuth wraps from 2π to 0 where a new ring begins. In files with another order (shuffled, cropped,
or starting mid-turn), each point is assigned to the laser nearest to its elevation. The HDL-64 reaches only about +3°,
so of the 16 elevations of a VLP-16, those within 1° of a recorded ring remain, about ten.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.formats.velodyne.elevations import VLP16_ELEVATIONS_DEG
from pipeline.types import F32, F64, U8

_MATCH_DEG = 1.0
_FAR_M = 10.0
_ENOUGH_POINTS = 50
RINGS = 64
NOMINAL_ELEVATIONS_DEG: F64 = np.concatenate([2.0 - np.arange(32) / 3.0, -8.83 - 0.5 * np.arange(32)])
"""(64,) highest first: 32 lasers from +2° in steps of 1/3°, 32 from −8.83° in steps of 1/2° (HDL-64E user's manual)."""
_ORDER_SLACK_DEG = 0.5
"""How far a ring may lie above the previous one for the file to count as ordered: this is the uncertainty of the median
of a mostly occluded ring."""

Turns = npt.NDArray[np.int64]


def turns(points: F32) -> Turns:
    """(N,) int64: number of rings before each of (N, 4) points in the file's order, 0 = the highest ring.

    A step back over straight ahead counts backwards, so that jitter there does not create a ring.
    """
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    azimuth = np.where(azimuth < 0.0, azimuth + 2.0 * np.pi, azimuth)
    step = np.diff(azimuth)
    wraps = (step < -np.pi).astype(np.int64) - (step > np.pi).astype(np.int64)
    counted = np.zeros(len(points), dtype=np.int64)
    np.cumsum(wraps, out=counted[1:])
    return np.maximum(counted, 0).astype(np.int64, copy=False)


def ring_elevations_deg(points: F32, turn: Turns, count: int) -> F64:
    """(count,) median elevation of each ring in degrees, NaN if it has no point.

    The HDL-64's lasers sit up to 0.2 m apart, which distorts the angles of near returns, so only points beyond 10 m are
    used if there are enough.
    """
    range_m = np.hypot(points[:, 0], points[:, 1])
    elevation, is_far = np.degrees(np.arctan2(points[:, 2], range_m)), range_m > _FAR_M
    by_ring = np.argsort(turn, kind="stable")  # which takes one pass if they are in order
    ends = np.searchsorted(turn[by_ring], np.arange(count + 1))
    medians = np.full(count, np.nan)
    for ring in range(count):
        of_ring = by_ring[ends[ring] : ends[ring + 1]]
        far = of_ring[is_far[of_ring]]
        chosen = far if len(far) >= _ENOUGH_POINTS else of_ring
        if len(chosen):
            medians[ring] = _median(elevation[chosen])
    return medians


def _median(values: F32) -> np.float32:
    """As NumPy's, whose checks take ten times as long for the few hundred points of a ring."""
    middle = len(values) // 2
    if len(values) % 2:
        return np.float32(np.partition(values, middle)[middle])
    low, high = np.partition(values, (middle - 1, middle))[middle - 1 : middle + 1]
    return np.float32((low + high) / 2)


def is_in_order(elevations_deg: F64) -> bool:
    """Whether the counted rings are plausible: at most as many as the HDL-64 has lasers, and each below the previous
    one."""
    seen = elevations_deg[np.isfinite(elevations_deg)]
    return len(elevations_deg) <= RINGS and bool(np.all(np.diff(seen) <= _ORDER_SLACK_DEG))


def rings_by_elevation(points: F32, elevations_deg: F64) -> Turns:
    """(N,) int64: for each of (N, 4) points the nearest ring of (R,) elevations, highest first."""
    elevation = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
    between = (elevations_deg[1:] + elevations_deg[:-1]) / 2
    return np.searchsorted(-between, -elevation).astype(np.int64, copy=False)


def match_vlp16(elevations_deg: F64) -> dict[int, int]:
    """Recorded ring → VLP-16 channel (0 = −15°): for each channel the nearest recorded ring within 1°, each used
    once."""
    matched: dict[int, int] = {}
    for channel, wanted in enumerate(VLP16_ELEVATIONS_DEG):
        away = np.abs(elevations_deg - wanted)
        away[list(matched)] = np.nan
        if np.all(np.isnan(away)):
            break
        nearest = int(np.nanargmin(away))
        if away[nearest] <= _MATCH_DEG:
            matched[nearest] = channel
    return matched


def keep_rings(points: F32, turn: Turns, channels: dict[int, int]) -> tuple[F32, U8]:
    """The points whose ring is a key of ``channels``, and each one's channel: (K, 4) float32 and (K,) uint8."""
    none = 255
    channel_of_ring = np.full(max(int(turn.max(initial=0)), *channels, 0) + 1, none, dtype=np.uint8)
    for ring, channel in channels.items():
        channel_of_ring[ring] = channel
    channel_of_point = channel_of_ring[turn]
    kept = channel_of_point != none
    return np.ascontiguousarray(points[kept]), channel_of_point[kept]
