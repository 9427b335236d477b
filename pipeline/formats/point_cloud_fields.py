"""Point clouds with named fields, as ROS messages and PCD files hold them → points, rings and times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.formats.float_points import FARTHEST_M
from pipeline.formats.velodyne.elevations import VLP16_ELEVATIONS_DEG
from pipeline.types import F32, F64, U8, Sweep
from pipeline.types.source import SourceError

_RING_NAMES = ("ring", "channel", "laser_id")
_INTENSITY_NAMES = ("intensity", "i", "reflectivity")
_SECONDS = ("time", "t", "timestamp", "time_stamp", "time_offset")
MOST_POINTS = 4_000_000
"""Of a cloud in a file or message: more than ten times those of the largest LiDARs."""
_LONGEST_SWEEP_S = 1.0
"""Times of points farther from the sweep's own than this are of another clock and left out."""
_FEWEST_A_RING = 20
"""Points of a ring below which its mean elevation says too little."""
_VLP16 = len(VLP16_ELEVATIONS_DEG)


class Cloud(NamedTuple):
    """A point cloud in the sensor's own axes."""

    xyz: F32
    """(N, 3) float32, metres."""
    intensity: F32
    """(N,) float32, 0–255."""
    ring: U8
    """(N,) from 0, the lowest, upwards."""
    channels: int
    """Number of rings that the sensor has."""
    time_s: F32 | None
    """(N,) after the cloud's stamp; None where points carry no time."""

    def sweep(self, t_ns: int, T_ego_lidar: F64) -> Sweep:
        """In the ego frame."""
        points = np.empty((len(self.xyz), 4), dtype=np.float32)
        points[:, :3] = self.xyz
        if not np.array_equal(T_ego_lidar, np.eye(4)):
            points[:, :3] = self.xyz @ T_ego_lidar[:3, :3].T.astype(np.float32) + T_ego_lidar[:3, 3].astype(np.float32)
        points[:, 3] = self.intensity
        x, y, z = T_ego_lidar[:3, 3].tolist()
        return Sweep(t_ns, points, self.ring, self.channels, self.time_s, (x, y, z))


def cloud_of(raw: npt.NDArray[np.void], t_ns: int, notes: list[str]) -> Cloud:
    """The points of a structured array with fields ``x y z`` and maybe intensity, ring and time.

    Points that are not finite, at the origin or farther than a kilometre are left out. A cloud without rings gets those
    of a VLP-16 by elevation; rings counted from above are turned round. A time is taken as seconds or nanoseconds after
    the stamp, or as absolute, by its size. SourceError when no point is left.
    """
    names = {name for name in raw.dtype.names or () if raw.dtype[name].shape == ()}
    if not {"x", "y", "z"} <= names:
        raise SourceError("a point cloud without x, y and z")
    with np.errstate(invalid="ignore", over="ignore"):  # signalling NaNs and huge numbers of a damaged file
        xyz = np.column_stack([raw[axis].astype(np.float32) for axis in "xyz"])
        good = np.all(np.abs(xyz) < FARTHEST_M, axis=1) & np.any(xyz != 0.0, axis=1)
        if not good.any():
            raise SourceError("no LiDAR points")
        xyz, kept = np.ascontiguousarray(xyz[good]), raw[good]
        ring, channels = _rings(kept, xyz, names, notes)
        return Cloud(xyz, _intensity(kept, names), ring, channels, _times(kept, t_ns, names))


def _intensity(kept: npt.NDArray[np.void], names: set[str]) -> F32:
    name = next((name for name in _INTENSITY_NAMES if name in names), None)
    if name is None:
        return np.zeros(len(kept), dtype=np.float32)
    values = np.nan_to_num(kept[name].astype(np.float32), nan=0.0, posinf=0.0, neginf=0.0)
    is_share = np.issubdtype(kept.dtype[name], np.floating) and float(values.max(initial=0.0)) <= 1.0
    return np.asarray(np.clip(values * (255.0 if is_share else 1.0), 0.0, 65_535.0), dtype=np.float32)


def _rings(kept: npt.NDArray[np.void], xyz: F32, names: set[str], notes: list[str]) -> tuple[U8, int]:
    elevation = np.degrees(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])))
    name = next((name for name in _RING_NAMES if name in names and np.issubdtype(kept.dtype[name], np.integer)), None)
    if name is None or int(kept[name].max()) > 255 or int(kept[name].min()) < 0:
        notes.append("no ring numbers: assigned by elevation, as on a VLP-16")
        ring = np.rint((elevation - VLP16_ELEVATIONS_DEG[0]) / 2.0)
        return np.clip(ring, 0, _VLP16 - 1).astype(np.uint8), _VLP16
    ring = kept[name].astype(np.int64)
    channels = max(_VLP16, int(ring.max()) + 1)
    counts = np.bincount(ring, minlength=channels)
    filled = np.flatnonzero(counts >= _FEWEST_A_RING)
    if len(filled) > 1:
        means = np.bincount(ring, weights=elevation, minlength=channels)[filled] / counts[filled]
        if means[-1] < means[0]:  # some count from above
            ring = channels - 1 - ring
    return ring.astype(np.uint8), channels


def _times(kept: npt.NDArray[np.void], t_ns: int, names: set[str]) -> F32 | None:
    """Seconds after the stamp; None when there are none, or they make no sense."""
    name = next((name for name in _SECONDS if name in names), None)
    if name is None:
        return None
    values = kept[name].astype(np.float64)
    if not np.all(np.isfinite(values)):
        return None
    if np.issubdtype(kept.dtype[name], np.integer):
        values = values * 1e-9
    if values.max() > 1e15:
        values = values * 1e-9
    if values.max() > 1e6:
        values = values - t_ns / 1e9
    return values.astype(np.float32) if float(np.abs(values).max()) < _LONGEST_SWEEP_S else None
