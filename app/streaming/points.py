"""Every point of the sweep as pages receive it: small integers, one array per property."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.alignment.projection import Alignment
from pipeline.types import DROPPED, F32, F64, GROUND, I32, UNCLUSTERED, Frame, Result

UNSEEN = -32768
"""Pixel coordinate of points outside the camera's view."""
UNKNOWN_AGE = 255
_LIMIT = 32767
_CODES = ((GROUND, 0), (UNCLUSTERED, 1), (DROPPED, 3))
_CLUSTER = 2
U8 = npt.NDArray[np.uint8]


def point_arrays(frame: Frame, result: Result, aligned: Alignment | None, scale: float) -> bytes:
    """The message's last part, in the layout of ``app.streaming.encode``. ``scale``: sent pixels per image pixel."""
    points, kind = result.layers.points, result.layers.kind
    places = points[:, :3].astype(np.float64)
    xyz = np.clip(np.round(places * 100.0), -_LIMIT, _LIMIT).astype("<i2")
    uv: npt.NDArray[np.int16] = np.full((len(points), 2), UNSEEN, "<i2")
    if aligned is not None and len(points):
        uv = _pixels(aligned.project(places) * scale)
    parts = (
        xyz,
        uv,
        _owners(result, kind),
        _codes(kind),
        _intensity(points),
        _rings(frame, points),
        _ages(frame, points),
    )
    return b"".join(part.tobytes() for part in parts)


def _pixels(uv: F64) -> npt.NDArray[np.int16]:
    seen = ~np.isnan(uv[:, :1])
    return np.where(seen, np.clip(np.nan_to_num(uv), -_LIMIT, _LIMIT), UNSEEN).round().astype("<i2")


def _owners(result: Result, kind: I32) -> npt.NDArray[np.uint16]:
    """(N,) for each point, 1 + index of its object in ``result.objects``."""
    cluster_of_track = {t.id: t.obstacle.cluster for t in result.layers.lidar_tracks if not t.carried}
    owner: npt.NDArray[np.uint16] = np.zeros(int(kind.max(initial=-1)) + 2, "<u2")
    for place, item in enumerate(result.objects):
        cluster = cluster_of_track.get(item.lidar_track) if item.lidar_track is not None else None
        if cluster is not None and 0 <= cluster < len(owner) - 1:
            owner[cluster] = place + 1
    return owner[np.where(kind >= 0, kind, len(owner) - 1)]


def _codes(kind: I32) -> U8:
    codes: U8 = np.full(len(kind), _CLUSTER, np.uint8)
    for value, code in _CODES:
        codes[kind == value] = code
    return codes


def _intensity(points: F32) -> U8:
    """0–255. KITTI's reflectance ranges from 0 to 1, a Velodyne's from 0 to 255."""
    values = points[:, 3]
    full = 255.0 if float(values.max(initial=0.0)) <= 1.0 else 1.0
    return np.clip(values * full, 0.0, 255.0).astype(np.uint8)


def _rings(frame: Frame, points: F32) -> U8:
    ring = frame.sweep.ring if frame.sweep is not None else np.zeros(0, np.uint8)
    return ring.astype(np.uint8, copy=False) if len(ring) == len(points) else np.zeros(len(points), np.uint8)


def _ages(frame: Frame, points: F32) -> U8:
    """Milliseconds before the newest point of the sweep, at most 254; ``UNKNOWN_AGE`` if the recording has no times of
    the points."""
    time_s = frame.sweep.time_s if frame.sweep is not None else None
    if time_s is None or len(time_s) != len(points) or not len(points):
        return np.full(len(points), UNKNOWN_AGE, np.uint8)
    return np.clip((time_s.max() - time_s) * 1e3, 0.0, UNKNOWN_AGE - 1).astype(np.uint8)
