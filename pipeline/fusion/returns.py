"""Ranges far vehicles by single returns: the few LiDAR points inside the box of a vehicle that is too far for a
cluster.

Beyond 35 m, a VLP-16 puts one to four points on a car: too few for a cluster, but accurate. Where the camera gives a
vehicle's direction and approximate distance, such a point gives the exact distance, if it belongs to the vehicle. Five
tests decide that:

- it is inside the box, away from its edges, above the road, no higher than a vehicle, and not seen over the roof;
- it cannot be of a nearer vehicle, whose box covers it or ends just beside it;
- its range agrees with the camera's, within the variation of vehicle heights;
- its surface ends with the vehicle: a wall, a hedge or the road behind continues on both sides at the same range;
- no second group of points fits the box about as well.

Points of a cluster are left to fusion, so no object is duplicated.

Beyond a crest, a vehicle may be hit by one ring only, about where that ring would meet a level road, and its points are
taken for road. Such a row is the vehicle's if it lies well above the lower edge of the box, where the vehicle meets the
road, and ends on both sides, where a road would continue.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numba
import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64
from pipeline.common.made_sweep import made_sweep
from pipeline.fusion.boxes_in_front import nearer
from pipeline.fusion.free_road import SweepRays
from pipeline.params import FusionParams
from pipeline.types import GROUND, I32, VEHICLES, VisionMeasurement
from pipeline.types.ground_planes import ground_z

NEAREST_M = 30.0
"""Minimum distance, by the camera and by the returns. Closer vehicles have a cluster or are occluded: at 30 m, a car
returns 30 points. A few closer returns in a vehicle's box are of a post or a sign in front of it. On Astyx, one of 38
ranges would have been closer: 29.3 m, of a car at 32.1 m."""
SIGMA_M = 0.5
"""Standard deviation of a vehicle's nearest point measured by a few returns. Measured on Astyx beyond 30 m: 80 %
between −0.4 and +0.4 m; a return from a roof or flank lies up to 2.5 m farther, which is less than σ of the camera's
distance there."""
_EDGE_SHARE = 0.08
"""Margin at either side as a share of the box's width: boxes drawn too wide, and calibration errors of a pixel or
two."""
_BOTTOM_SHARE = 0.06
LOW_M, HIGH_M = 0.25, 3.5
"""Heights above the road between which a vehicle returns rays."""
_SIGMAS = 3.0
"""The range must agree with the camera's within this many standard deviations."""
_GAP_M = 1.0
"""Points with a larger difference in range belong to two objects, or to two faces of one."""
_BESIDE_SHARE = 0.6
"""Search width to either side of the box, in box widths, for a structure that continues beyond the box."""
_SAME_RANGE_M, _SAME_HEIGHT_DEG = 1.5, 1.0
_CLEARLY = 1.0
"""Minimum difference of log-likelihood between the best and the second-best group."""
_LOW_NEAREST_M, _LOW_POINTS = 20.0, 3
"""Minimum distance of a vehicle that only one ring hits, and minimum number of its points: one or two may be dirt."""
_LOW_BOTTOM_SHARE = 0.2
"""Minimum height of such a row above the lower edge of the box, as a share of the box's height: 0.3 m of a car. Half a
degree between the sensors is 0.26 m at 30 m."""
_LOW_SIGMAS, _LOW_SPAN = 1.5, 0.5
"""Number of standard deviations by which its range may differ from the camera's, and minimum share of the box's width
that it spans: the same as for points of merged clusters. In 200 frames of Astyx and KITTI, which have no crest, two
rows pass, neither on a vehicle that could lead."""
_LOW_BEYOND = 0.5
"""The same for a row that is farther away than the camera says: it may be the road behind the vehicle, between the
shadows of others, where the sensors are not aligned."""
_LOW_FROM_SHARE, _LOW_TO_SHARE = 0.35, 0.95
"""The road beside a vehicle is searched from here to there outside the box, in box widths. Half a degree between the
sensors and the box's own error shift the vehicle's points by up to the first."""


class SweepReturns(SweepRays, Protocol):
    """A segmented sweep, with the parts needed to evaluate single points."""

    @property
    def kind(self) -> I32:
        """(N,) classification of each point: ≥ 0 a cluster, −1 ground."""
        ...


class _Points(NamedTuple):
    """Far points of a sweep: those above the road, or those taken for road."""

    uv: F64
    range_m: F64
    """Horizontal, from the ego origin."""
    elevation_deg: F64
    """Elevation seen from the sensor."""
    clustered: np.ndarray


class _Group(NamedTuple):
    """Points at about one range inside a box."""

    rows: np.ndarray
    fit: float
    """Log-likelihood that the points belong to the vehicle."""


def range_boxes(
    boxes: tuple[VisionMeasurement, ...] | None,
    sweep: SweepReturns,
    alignment: Alignment | None,
    params: FusionParams,
) -> tuple[VisionMeasurement, ...] | None:
    """The boxes; those of far vehicles get ``ranged_m`` and ``returns`` if the sweep contains returns from them."""
    if not params.single_returns or not boxes or alignment is None or sweep.ground is None:
        return boxes
    asked = [each.detection.label in VEHICLES and (each.distance_m or 0.0) >= _LOW_NEAREST_M for each in boxes]
    if not any(asked):
        return boxes
    rows, range_m = _far_and_high(
        sweep.points, sweep.kind, sweep.ground.planes, sweep.ground.edges, NEAREST_M, LOW_M, HIGH_M
    )
    points = _points(sweep, rows, range_m, alignment)
    rows, range_m = _far_road(sweep.points, sweep.kind, _LOW_NEAREST_M / 2)
    road = _points(sweep, rows, range_m, alignment)
    placed = _placed(boxes)
    in_front = nearer(placed[:, :4])
    return tuple(
        _ranged(each, points, road, placed[covers], params.roof_share) if ask else each
        for each, ask, covers in zip(boxes, asked, in_front, strict=True)
    )


def _placed(boxes: tuple[VisionMeasurement, ...]) -> F64:
    """(M, 6): each box, and the ranges between which returns from it lie; any range where it has no distance."""
    rows = []
    for each in boxes:
        nearest_m, farthest_m = 0.0, math.inf
        if each.distance_m is not None and each.sigma_m is not None:
            spread = math.exp(_SIGMAS * each.sigma_m / each.distance_m)
            nearest_m, farthest_m = each.distance_m / spread, each.distance_m * spread
        rows.append((*each.detection.bbox, nearest_m, farthest_m))
    return np.array(rows, dtype=np.float64)


def _points(sweep: SweepReturns, rows: np.ndarray, range_m: F64, alignment: Alignment) -> _Points:
    xyz = sweep.points[rows, :3].astype(np.float64)
    seen = xyz - np.array(sweep.origin)
    elevation_deg = np.degrees(np.arctan2(seen[:, 2], np.hypot(seen[:, 0], seen[:, 1])))
    return _Points(alignment.project(xyz), range_m, elevation_deg, sweep.kind[rows] >= 0)


@numba.njit(cache=True, nogil=True)
def _far_and_high(points, kind, planes, edges, nearest_m, low_m, high_m):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(M,) rows of the points ahead that are farther than ``nearest_m``, between two heights over the ground and not
    ground themselves; (M,) their ranges."""
    rows, ranges_m = np.empty(len(points), np.int64), np.empty(len(points))
    count = 0
    for n in range(len(points)):
        x, y, z = np.float64(points[n, 0]), np.float64(points[n, 1]), np.float64(points[n, 2])
        if kind[n] == GROUND or not x > 0.0:
            continue
        height_m = z - ground_z(planes, edges, x, y)
        if height_m > low_m and height_m < high_m:
            range_m = np.hypot(x, y)
            if range_m > nearest_m:
                rows[count], ranges_m[count] = n, range_m
                count += 1
    return rows[:count].copy(), ranges_m[:count].copy()


@numba.njit(cache=True, nogil=True)
def _far_road(points, kind, nearest_m):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(M,) rows of the points ahead that are farther than ``nearest_m`` and were taken for road; (M,) their ranges."""
    rows, ranges_m = np.empty(len(points), np.int64), np.empty(len(points))
    count = 0
    for n in range(len(points)):
        x, y = np.float64(points[n, 0]), np.float64(points[n, 1])
        if kind[n] == GROUND and x > 0.0 and np.hypot(x, y) > nearest_m:
            rows[count], ranges_m[count] = n, np.hypot(x, y)
            count += 1
    return rows[:count].copy(), ranges_m[:count].copy()


def _ranged(
    seen: VisionMeasurement, points: _Points, road: _Points, in_front: F64, roof_share: float
) -> VisionMeasurement:
    by_returns = _by_returns(seen, points, in_front, roof_share) if (seen.distance_m or 0.0) >= NEAREST_M else seen
    return by_returns if by_returns.returns else _by_low_row(seen, road)


def _by_low_row(seen: VisionMeasurement, road: _Points) -> VisionMeasurement:
    """The box ranged by a row of points that were taken for road."""
    assert seen.distance_m is not None
    assert seen.sigma_m is not None
    x1, y1, x2, y2 = seen.detection.bbox
    inner = (x1, y1, x2, y2 - _LOW_BOTTOM_SHARE * (y2 - y1))
    share = _LOW_SIGMAS / _SIGMAS * seen.sigma_m / seen.distance_m
    rows = _inside(road.uv, road.range_m, inner, seen.distance_m, share)
    rows = rows[road.range_m[rows] < seen.distance_m * math.exp(_LOW_BEYOND * seen.sigma_m / seen.distance_m)]
    groups = np.split(rows, np.flatnonzero(np.diff(road.range_m[rows]) > _GAP_M) + 1)
    row = max(groups, key=len)
    if len(row) < _LOW_POINTS or np.ptp(road.uv[row, 0]) < _LOW_SPAN * (x2 - x1):
        return seen
    near, far = _LOW_FROM_SHARE * (x2 - x1), _LOW_TO_SHARE * (x2 - x1)
    u, alike = road.uv[:, 0], np.abs(road.range_m - road.range_m[row[0]]) < _SAME_RANGE_M
    with np.errstate(invalid="ignore"):
        beside = ((u > x1 - far) & (u < x1 - near)) | ((u > x2 + near) & (u < x2 + far))
    if (alike & beside).any():
        return seen
    return evolve(seen, ranged_m=float(road.range_m[row[0]]), ranged_sigma_m=SIGMA_M, returns=len(row))


def _by_returns(seen: VisionMeasurement, points: _Points, in_front: F64, roof_share: float) -> VisionMeasurement:
    """The box ranged by points above the road. in_front: (K, 6) nearer boxes, as returned by ``_placed``.

    In the uppermost part of a box, what is farther away than the camera says is beyond the vehicle: of 50 such points
    in the upper 12 %, 42 had passed over a labelled one (15 of 17 on Astyx, 27 of 33 on KITTI 0009), but only 7 of 23
    in the next 6 %.
    """
    assert seen.distance_m is not None
    assert seen.sigma_m is not None
    x1, y1, x2, y2 = seen.detection.bbox
    side, bottom, share = _EDGE_SHARE * (x2 - x1), _BOTTOM_SHARE * (y2 - y1), seen.sigma_m / seen.distance_m
    inner = (x1 + side, y1, x2 - side, y2 - bottom)
    rows = _inside(points.uv, points.range_m, inner, seen.distance_m, share)
    over_roof = (points.uv[rows, 1] < y1 + roof_share * (y2 - y1)) & (points.range_m[rows] > seen.distance_m)
    rows = rows[~over_roof]
    rows = rows[~_may_be_of(in_front, points.uv[rows], points.range_m[rows])]
    if not len(rows):
        return seen
    off = np.log(points.range_m[rows] / seen.distance_m) / share
    starts = [0, *(np.flatnonzero(np.diff(points.range_m[rows]) > _GAP_M) + 1).tolist()]
    ends = [*starts[1:], len(rows)]
    groups = [
        _Group(rows[start:end], math.log(end - start) - 0.5 * float(off[start]) ** 2)
        for start, end in zip(starts, ends, strict=True)
    ]
    groups.sort(key=lambda group: -group.fit)
    best = groups[0].rows
    if len(groups) > 1 and groups[0].fit - groups[1].fit < _CLEARLY:
        return seen
    if points.clustered[best].any() or _goes_on(points, best, (x1, x2)):
        return seen
    return evolve(seen, ranged_m=float(points.range_m[best[0]]), ranged_sigma_m=SIGMA_M, returns=len(best))


def _may_be_of(in_front: F64, uv: F64, range_m: F64) -> np.ndarray:
    """(P,) whether points may be of one of the boxes in front, (K, 6): they lie in it, or just beside it, at a range
    that it may have. What is seen over or through a nearer vehicle is far beyond it. Just beside it, the next car of a
    parked row shows a strip that is too narrow for a box of its own: a van 88 m away, seen past the end of such a row,
    was placed at a third of its distance by that strip."""
    x1, y1, x2, y2, nearest_m, farthest_m = in_front.T
    side = _EDGE_SHARE * (x2 - x1)
    x1, x2 = x1 - side, x2 + side
    u, v, r = uv[:, :1], uv[:, 1:], range_m[:, None]
    inside = (u > x1) & (u < x2) & (v > y1) & (v < y2)
    return np.asarray((inside & (r > nearest_m) & (r < farthest_m)).any(axis=1))


def _goes_on(points: _Points, group: np.ndarray, box: tuple[float, float]) -> bool:
    """Whether the structure that a group belongs to continues on both sides of the box (left and right edge, pixels),
    at the same range and about the same height."""
    x1, x2 = box
    reach = _BESIDE_SHARE * (x2 - x1)
    range_m, low, high = points.range_m[group[0]], points.elevation_deg[group].min(), points.elevation_deg[group].max()
    u = points.uv[:, 0]
    with np.errstate(invalid="ignore"):
        alike = np.abs(points.range_m - range_m) < _SAME_RANGE_M
        alike &= (points.elevation_deg > low - _SAME_HEIGHT_DEG) & (points.elevation_deg < high + _SAME_HEIGHT_DEG)
        left, right = alike & (u > x1 - reach) & (u < x1), alike & (u > x2) & (u < x2 + reach)
    return bool(left.any() and right.any())


@numba.njit(cache=True, nogil=True)
def _inside(uv, range_m, box, distance_m, share):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(K,) rows of the points inside a box (x1, y1, x2, y2) whose range agrees with the camera's, by range. Points
    behind the camera have no pixel: NaN."""
    found, count = np.empty(len(uv), np.int64), 0
    for n in range(len(uv)):
        u, v = uv[n, 0], uv[n, 1]
        is_inside = u > box[0] and u < box[2] and v > box[1] and v < box[3]
        if is_inside and abs(np.log(range_m[n] / distance_m) / share) < _SIGMAS:
            found[count] = n
            count += 1
    rows = found[:count]
    return rows[np.argsort(range_m[rows], kind="mergesort")]


def warm_up() -> None:
    """Compile the kernels, or load them from numba's cache."""
    planes, edges = np.array([[0.0, 0.0, 1.0, 0.0]]), np.array([0.0, 1.0])
    points, _ = made_sweep()
    _far_and_high(points, np.zeros(2, np.int32), planes, edges, 1.0, 0.0, 2.0)
    _far_road(points, np.zeros(2, np.int32), 1.0)
    _inside(np.zeros((1, 2)), np.ones(1), (0.0, 0.0, 1.0, 1.0), 1.0, 0.1)
