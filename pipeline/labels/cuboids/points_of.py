"""Selects the points of a sweep that belong to the vehicle in, or near, a cuboid."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.lidar.cluster import candidates, cluster
from pipeline.lidar.ground import Ground, fit_ground
from pipeline.params import ClusterParams, GroundParams
from pipeline.types import F32, I32

FEWEST_POINTS = 5
MARGIN_M = 0.6
"""Position tolerance of a cuboid drawn by hand."""
_INSIDE_M = 0.15
_LONGEST_M = 2.0
"""A cluster that extends farther beyond the cuboid contains the vehicle and something beside it: only the near part is
used."""
CLUSTERS = ClusterParams(front_only=False, min_points=FEWEST_POINTS)
"""Vehicles are labelled all round, and with fewer points than the pipeline needs."""


@dataclass(frozen=True)
class Clustered:
    """A sweep with its ground and clusters."""

    points: F32
    """(N, 4) float32 x y z intensity, ego frame."""
    ground: Ground
    """Ground of the sweep."""
    labels: I32
    """(N,) cluster of each point, −1 for none."""


def clustered(sweep: F32) -> Clustered:
    """sweep: (N, 4) float32 ``x y z intensity``, ego frame."""
    every = np.ones(len(sweep), dtype=bool)
    ground = fit_ground(sweep, every, GroundParams())
    return Clustered(sweep, ground, cluster(sweep, candidates(sweep, ground, every, CLUSTERS), CLUSTERS))


def points_of(sweep: Clustered, cuboid: Cuboid) -> F32 | None:
    """(M, 4) points of the cluster with the most points in the cuboid, else near it, without those of anything grown
    together with the vehicle; None without one."""
    whole = _cluster(sweep, cuboid)
    if whole is None:
        return None
    grown_together = bool((whole & ~inside(sweep.points, cuboid, _LONGEST_M)).any())
    return sweep.points[whole & inside(sweep.points, cuboid, MARGIN_M)] if grown_together else sweep.points[whole]


def whole_cluster(sweep: Clustered, cuboid: Cuboid) -> F32 | None:
    """(M, 4) all points of the cluster that ``points_of`` takes points from; None without one."""
    whole = _cluster(sweep, cuboid)
    return sweep.points[whole] if whole is not None else None


def _cluster(sweep: Clustered, cuboid: Cuboid) -> np.ndarray | None:
    """(N,) bool."""
    found = sweep.labels[inside(sweep.points, cuboid, _INSIDE_M) & (sweep.labels >= 0)]
    if len(found) == 0:
        found = sweep.labels[inside(sweep.points, cuboid, MARGIN_M) & (sweep.labels >= 0)]
    return sweep.labels == np.bincount(found).argmax() if len(found) else None


def inside(points: F32, cuboid: Cuboid, margin_m: float) -> np.ndarray:
    """(N,) bool: points in the cuboid enlarged on every side, from the ground up."""
    c, s = math.cos(cuboid.yaw_rad), math.sin(cuboid.yaw_rad)
    dx, dy = points[:, 0] - cuboid.center[0], points[:, 1] - cuboid.center[1]
    along, across = np.abs(c * dx + s * dy), np.abs(c * dy - s * dx)
    up = np.abs(points[:, 2] - cuboid.center[2])
    half = [side / 2 + margin_m for side in cuboid.size]
    return (along <= half[0]) & (across <= half[1]) & (up <= half[2] + 0.5)
