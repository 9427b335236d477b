"""Synthetic sweeps of a VLP-16 over a plane road with boxes on it, by intersecting rays; and real sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import rotation
from pipeline.sources import open_source
from pipeline.types import F32, F64, Frame
from pipeline.types.source import TruthObject

Block = tuple[float, float, float, float, float, float]
"""Minimum x, y, z and maximum x, y, z."""


def scan(blocks: Sequence[Block] = (), height_m: float = 1.5, tilt_deg: tuple[float, float] = (0.0, 0.0)) -> F32:
    """(N, 4) returns of 16 rings with 600 columns within 60 m. The road is ``height_m`` below the sensor, blocks are
    given in the sensor's frame, and the result is then rotated by (roll, pitch)."""
    elevation = np.radians(np.arange(-15.0, 16.0, 2.0))
    azimuth = np.radians(np.arange(0.0, 360.0, 0.6))
    e, a = (g.ravel() for g in np.meshgrid(elevation, azimuth))
    ray = np.column_stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(ray[:, 2] < 0, -height_m / ray[:, 2], np.inf)
        for block in blocks:
            low, high = np.array(block[:3]) / ray, np.array(block[3:]) / ray
            enter = np.nanmax(np.minimum(low, high), axis=1)
            leave = np.nanmin(np.maximum(low, high), axis=1)
            hit = (enter <= leave) & (enter > 0.0)
            reach = np.where(hit, np.minimum(reach, enter), reach)
    seen = reach < 60.0
    xyz = ray[seen] * reach[seen, None] @ rotation(np.radians(tilt_deg[0]), np.radians(tilt_deg[1]), 0.0).T
    return np.column_stack([xyz, np.zeros(len(xyz))]).astype(np.float32)


def road_height(xy: F64, height_m: float, tilt_deg: tuple[float, float]) -> F64:
    """The road's z at positions in the rotated frame."""
    normal = rotation(np.radians(tilt_deg[0]), np.radians(tilt_deg[1]), 0.0)[:, 2]
    return np.asarray((-height_m - xy @ normal[:2]) / normal[2])


@cache
def real_frames(data_dir: Path) -> tuple[tuple[Frame, tuple[TruthObject, ...]], ...]:
    """Every real frame: Astyx (16 rings), and KITTI reduced to a VLP-16 (about 10 rings). Read once per process and
    kept without images, which LiDAR tests do not need."""
    sources = [open_source(f"astyx:{data_dir / 'astyx'}"), open_source(f"kitti:{data_dir / 'kitti_0052'}")]
    return tuple(
        (evolve(source.frame(index), image=None), source.truth(index) or ())
        for source in sources
        for index in range(len(source))
    )
