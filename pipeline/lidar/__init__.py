"""The LiDAR branch: deskew, down-sample, ground, cluster, boxes, tracking (paper, Point Cloud Segmentation, LiDAR
Tracking)."""

from __future__ import annotations

import numpy as np

from pipeline.lidar import (
    boxes,
    cluster,
    deskew,
    divide_tracked,
    downsample,
    ground,
    road_profile,
    track_history,
    tracking,
)
from pipeline.params import DeskewParams, Params
from pipeline.types import EgoState, Sweep


def warm_up() -> None:
    """Compile every kernel, or load it from numba's cache, using a synthetic sweep: a flat road with one wall on it."""
    params = Params()
    x, y = np.meshgrid(np.linspace(3.0, 20.0, 20), np.linspace(-5.0, 5.0, 20))
    road = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -1.5), np.zeros(x.size)])
    wall = np.column_stack([np.full(20, 15.0), np.linspace(-1.0, 1.0, 20), np.full(20, -0.5), np.zeros(20)])
    points = np.vstack([road, wall]).astype(np.float32)
    keep = np.ones(len(points), dtype=np.bool_)
    time_s = np.zeros(len(points), np.float32)
    sweep = Sweep(0, points, np.zeros(len(points), np.uint8), 16, time_s)
    track_history.warm_up()
    plane = ground.fit_ground(points, keep, params.ground)
    labels = cluster.cluster(points, cluster.candidates(points, plane, keep, params.cluster), params.cluster)
    obstacles = boxes.fit_obstacles(points, labels, plane, params.box)
    state, _ = tracking.track(tracking.LidarTrackerState(), obstacles, None, params.lidar_tracking)
    state, tracks = tracking.track(state, obstacles, 0.1, params.lidar_tracking)
    divide_tracked.warm_up(points, labels, tracks)
    cluster.kinds(labels, keep, plane.mask)
    road_profile.fit_road_profile(points, plane.mask)
    deskew.deskew(sweep, EgoState(0, 10.0, 0.0), DeskewParams(enabled=True))
    downsample.keep_mask(sweep, params.downsample)
