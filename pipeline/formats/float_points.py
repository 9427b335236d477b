"""Sweeps as bare float32 numbers, as KITTI and nuScenes keep them: so many a point, ``x y z intensity`` first."""

from __future__ import annotations

import numpy as np

from pipeline.types import F32
from pipeline.types.source import SourceError

FARTHEST_M = 1000.0
"""No LiDAR measures farther: such numbers are damaged."""


def parse_points(data: bytes, file: str, columns: int, brightest: float, notes: list[str]) -> F32:
    """(N, columns) float32 from a file. Points that are not finite, farther than a kilometre or without an intensity
    from 0 to ``brightest`` are left out and counted in ``notes``, as is a truncated last point; points at the sensor
    itself are not returns and are ignored. SourceError if none is left."""
    whole = len(data) // (4 * columns)
    if len(data) % (4 * columns):
        notes.append(f"{file}: truncated in the middle of a point")
    raw = np.frombuffer(data, dtype="<f4", count=whole * columns).reshape(-1, columns)
    with np.errstate(invalid="ignore"):  # comparing a signalling NaN of a damaged file
        good = np.all(np.abs(raw[:, :3]) < FARTHEST_M, axis=1) & (raw[:, 3] >= 0.0) & (raw[:, 3] <= brightest)
    kept = raw[good & np.any(raw[:, :3] != 0.0, axis=1)]
    if not len(kept):
        raise SourceError(f"{file}: no LiDAR points")
    if not np.all(good):
        notes.append(f"{file}: {len(raw) - np.count_nonzero(good)} unreadable points skipped")
    return np.ascontiguousarray(kept, dtype=np.float32)
