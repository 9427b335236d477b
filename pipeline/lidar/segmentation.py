"""Segments one sweep into obstacles on the ground: deskew → down-sample → ground → cluster → divide → boxes (paper,
Point Cloud Segmentation)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.stopwatch import Stopwatch
from pipeline.lidar import boxes, cluster, deskew, divide_tracked, downsample, ground
from pipeline.lidar.tracking import LidarTrackerState
from pipeline.params import Params
from pipeline.types import F32, I32, U8, EgoState, Ground, Obstacle, Sweep


@dataclass(frozen=True)
class SegmentedSweep:
    """The segmentation of one sweep."""

    points: F32
    """(N, 4) float32 ``x y z intensity``, deskewed, before down-sampling."""
    ring: U8
    """(N,) uint8, the channel of each point."""
    kind: I32
    """(N,) int32, classification of each point (``pipeline.types.Layers``)."""
    obstacles: tuple[Obstacle, ...] | None
    """One per cluster; None without a sweep."""
    ground: Ground | None
    """The road under the sweep; None without a sweep."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Ego x y z of the sensor, where its rays start."""

    @property
    def sensor_height_m(self) -> float:
        """Height of the sensor above the road; NaN without ground."""
        return float(self.ground.above(np.array([self.origin]))[0]) if self.ground is not None else float("nan")


_NO_SWEEP = SegmentedSweep(np.zeros((0, 4), np.float32), np.zeros(0, np.uint8), np.zeros(0, np.int32), None, None)


def segment(
    sweep: Sweep | None,
    ego: EgoState | None,
    params: Params,
    clock: Stopwatch,
    before: LidarTrackerState | None = None,
    dt_s: float | None = None,
    road_before: Ground | None = None,
) -> SegmentedSweep:
    """Obstacles and ground of a sweep. ego: own motion, for deskewing. clock: records a lap for each stage. before:
    tracker state of the previous sweep, dt_s ago; None to segment each sweep independently. road_before: its ground."""
    # Move points to where they were at the tick, instead of while the sensor turned
    sweep = deskew.deskew(sweep, ego, params.deskew)
    clock.lap("deskew")
    if sweep is None:
        return _NO_SWEEP

    # Down-sample each channel and drop the car's own body
    keep = downsample.keep_mask(sweep, params.downsample)
    clock.lap("downsample")

    # The road: planes through the lowest points
    plane = ground.follow_ground(sweep.points, keep, params.ground, road_before)
    clock.lap("ground")

    # Objects on the road: neighbouring points form one cluster, also across the gaps between rings
    candidates = cluster.candidates(sweep.points, plane, keep, params.cluster)
    labels = cluster.cluster(sweep.points, candidates, params.cluster)
    if before is not None:  # split clusters of tracks that move apart
        labels = divide_tracked.divide(
            sweep.points, labels, before.tracks, before.filters, before.history, dt_s, params.cluster
        )
    clock.lap("cluster")

    # An upright box around each cluster
    obstacles = boxes.fit_obstacles(sweep.points, labels, plane, params.box)
    clock.lap("boxes")
    kinds = cluster.kinds(labels, keep, plane.mask)
    return SegmentedSweep(sweep.points, sweep.ring, kinds, obstacles, plane, sweep.origin)
