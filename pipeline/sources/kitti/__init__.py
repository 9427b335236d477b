"""KITTI's layouts: raw drives, the object benchmark, odometry sequences and KITTI-360."""

from __future__ import annotations

from pipeline.sources.kitti.source import KittiSource

__all__ = ["KittiSource"]
