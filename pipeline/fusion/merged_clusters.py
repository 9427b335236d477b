"""Ranges a near vehicle whose LiDAR cluster has merged with the roadside.

A car in front of a hedge, or parked along it, often forms one cluster with it. That cluster is longer than any vehicle,
so it is no object that a box could be joined with, and the car is left with the camera's distance, or, if the image's
edge cuts its box, with none. But its points are inside its box: the nearest group of them is its nearest face. Of 284
labelled vehicles within 30 m on Astyx and KITTI, 7 are in such a cluster.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64
from pipeline.fusion.returns import HIGH_M, LOW_M, SweepReturns
from pipeline.fusion.vehicle_sizes import largest_size_m
from pipeline.params import FusionParams
from pipeline.types import VEHICLES, Ground, Obstacle, VisionMeasurement

FARTHEST_M = 30.0
"""Beyond this, points are few, and ``returns`` ranges boxes by single ones."""
SIGMA_M = 0.3
"""Standard deviation of the nearest face's distance: points at the edge of a box may belong to what is behind it."""
_EDGE_SHARE = 0.1
"""Margin inside the box at either side and at the top, as a share of its size: boxes drawn too wide, and calibration
errors. Below it is the road, whose points do not count anyway."""
_GAP_M, _FEWEST = 0.5, 20
"""A group of points ends at a larger gap in range than the first, and counts with at least the second number: a car at
30 m returns 30 points."""
_FACE_M = 0.5
"""Depth of the nearest face. The vehicle is where these points are. In the middle of its box, whose points may be
metres farther away, a vehicle parked beside the path would seem to be in it."""
_COVERED = 0.5
"""Share of the box's width over which the group must extend: in a row of parked cars, the flank of a nearer one reaches
into the box of the next."""


_BESIDE_FROM, _BESIDE_TO, _ON_LINE_M = 0.05, 0.3, 0.3
"""A fence, a hedge or a wall before a vehicle is about as straight as the third, leaves the box on both sides, and goes
on there: between the first two, in box widths. A vehicle's face ends in the box. Boxes that the image's edge cuts are
exempt, because the vehicle goes on there itself."""


class SweepWithClusters(SweepReturns, Protocol):
    """A segmented sweep with its clusters."""

    @property
    def obstacles(self) -> tuple[Obstacle, ...] | None:
        """One per cluster."""
        ...


class _Merged(NamedTuple):
    """Points of clusters that are longer than a vehicle."""

    points: F64
    """(N, 3), ego frame."""
    uv: F64
    """(N, 2) pixels; NaN behind the camera."""


def range_boxes(
    boxes: tuple[VisionMeasurement, ...] | None,
    sweep: SweepWithClusters,
    alignment: Alignment | None,
    params: FusionParams,
) -> tuple[VisionMeasurement, ...] | None:
    """The boxes; those of near vehicles with points in a cluster that is longer than any vehicle of their class get
    ``ranged_m`` and ``returns``, the place of the nearest points, and a distance if the camera gives none. A camera's
    distance must agree with the range as with that of a cluster (``range_gate_sigmas``)."""
    if not params.merged_clusters or not boxes or alignment is None or sweep.ground is None or not sweep.obstacles:
        return boxes
    asked = [each.detection.label in VEHICLES and (each.distance_m or 0.0) < FARTHEST_M for each in boxes]
    longest = max(max(each.cuboid.size[:2]) for each in sweep.obstacles)
    if not any(asked) or longest <= largest_size_m("car")[0]:
        return boxes
    merged: dict[float, _Merged] = {}
    """Clusters by the length that they exceed: that of few classes."""
    ranged = []
    for each, ask in zip(boxes, asked, strict=True):
        if ask:
            longest_m = largest_size_m(each.detection.label)[0]
            if longest_m not in merged:
                merged[longest_m] = _longer_than(longest_m, sweep, sweep.obstacles, alignment)
            each = _ranged(each, merged[longest_m], sweep.ground, params)
        ranged.append(each)
    return tuple(ranged)


def _longer_than(
    longest_m: float, sweep: SweepWithClusters, obstacles: Sequence[Obstacle], alignment: Alignment
) -> _Merged:
    is_long = np.zeros(max(each.cluster for each in obstacles) + 1, dtype=np.bool_)
    is_long[[each.cluster for each in obstacles if max(each.cuboid.size[:2]) > longest_m]] = True
    rows = np.flatnonzero(sweep.kind >= 0)
    kind = sweep.kind[rows]
    known = kind < len(is_long)
    rows = rows[known][is_long[kind[known]]]
    points = sweep.points[rows, :3].astype(np.float64)
    return _Merged(points, alignment.project(points))


def _ranged(seen: VisionMeasurement, merged: _Merged, ground: Ground, params: FusionParams) -> VisionMeasurement:
    points, uv = merged
    is_inside = _is_inside(uv, seen.detection.bbox)
    inside, across = points[is_inside], uv[is_inside, 0]
    height_m = ground.above(inside)
    on_body = (height_m > LOW_M) & (height_m < HIGH_M)
    inside, across = inside[on_body], across[on_body]
    range_m = np.hypot(inside[:, 0], inside[:, 1])
    order = np.argsort(range_m, kind="stable")
    group = _nearest_group(range_m[order])
    if group is None:
        return seen
    rows = order[group]
    x1, _, x2, _ = seen.detection.bbox
    if np.ptp(across[rows]) < _COVERED * (x2 - x1):
        return seen
    nearest_m = float(range_m[rows[0]])
    if seen.distance_m is not None and seen.sigma_m is not None:
        if _continues(points, uv[:, 0], ground, inside[rows], (x1, x2)):
            return seen  # a fence or a hedge before the vehicle
        if abs(nearest_m - seen.distance_m) > params.range_gate_sigmas * seen.sigma_m:
            return seen  # a nearer vehicle of the same cluster
    else:
        seen = evolve(seen, distance_m=nearest_m, sigma_m=SIGMA_M)
    face = inside[rows[range_m[rows] < nearest_m + _FACE_M]]
    bearing = np.arctan2(np.median(face[:, 1]), np.median(face[:, 0]))
    return evolve(
        seen,
        position=(float(nearest_m * np.cos(bearing)), float(nearest_m * np.sin(bearing))),
        ranged_m=nearest_m,
        ranged_sigma_m=SIGMA_M,
        returns=len(rows),
    )


def _continues(points: F64, u: F64, ground: Ground, group: F64, edges_px: tuple[float, float]) -> bool:
    """Whether a group of points (M, 3) is a straight line that goes on beyond both sides of a box. points, u: (N, 3)
    and (N,) columns of all long clusters."""
    middle = group[:, :2].mean(axis=0)
    normal = np.linalg.svd(group[:, :2] - middle, full_matrices=False)[2][1]
    if np.sqrt(np.mean(((group[:, :2] - middle) @ normal) ** 2)) > _ON_LINE_M:
        return False
    above_m = ground.above(points)
    with np.errstate(invalid="ignore"):
        on_line = (above_m > LOW_M) & (above_m < HIGH_M) & (np.abs((points[:, :2] - middle) @ normal) < _ON_LINE_M)
        (left_px, right_px), width = edges_px, edges_px[1] - edges_px[0]
        is_left = (u > left_px - _BESIDE_TO * width) & (u < left_px - _BESIDE_FROM * width)
        is_right = (u > right_px + _BESIDE_FROM * width) & (u < right_px + _BESIDE_TO * width)
    return bool((on_line & is_left).any() and (on_line & is_right).any())


def _is_inside(uv: F64, bbox: tuple[float, float, float, float]) -> np.ndarray:
    """(N,) whether pixels, NaN behind the camera, lie well inside a box."""
    x1, y1, x2, y2 = bbox
    across, down = _EDGE_SHARE * (x2 - x1), _EDGE_SHARE * (y2 - y1)
    with np.errstate(invalid="ignore"):
        u, v = uv[:, 0], uv[:, 1]
        return np.asarray((u > x1 + across) & (u < x2 - across) & (v > y1 + down) & (v < y2))


def _nearest_group(range_m: F64) -> slice | None:
    """The nearest group with enough points, of (N,) sorted ranges; None without one."""
    cuts = np.concatenate([[0], np.flatnonzero(np.diff(range_m) > _GAP_M) + 1, [len(range_m)]])
    for start, end in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
        if end - start >= _FEWEST:
            return slice(start, end)
    return None
