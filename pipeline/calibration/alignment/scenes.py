"""The data of a frame that does not depend on the alignment: the detector's boxes, and the outlines of LiDAR clusters.

A box has four edges; an outline consists of the points whose projections bound a cluster in the image. Both sensors are
coarse, each in its own way, and an outline reflects this: a car's side is between the last beam that hit it and the
next that did not, its roof is between two rings, and its lower edge is on the road, where the beams may have missed it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from pipeline.common.stopwatch import Stopwatch
from pipeline.lidar import segmentation
from pipeline.lidar.ground import Ground
from pipeline.params import Params
from pipeline.types import F32, F64, VEHICLES, CameraCalibration, Frame, Sweep
from pipeline.vision.nms import select

NEAREST_M, FARTHEST_M = 4.0, 60.0
"""Closer, a car does not fit into the image; farther, only one or two of 16 rings hit it."""
LONGEST_M, LOWEST_M = 14.0, 0.6
"""Longer clusters are walls and hedges, lower ones kerbs."""
FEWEST_POINTS = 5
MIN_SCORE = 0.4
"""Boxes with lower scores are often of other objects."""
BORDER_PX = 3.0
"""A box this close to the image's border is cut, and its edge there carries no information."""
OUTLINE, ENDS = 12, 4
"""Number of points of an outline that represent its hull."""
_WIDEST_GAP_RAD = np.radians(4.0)
"""If the gap between rings is larger, there are rings in between that hit nothing."""


@dataclass(frozen=True, eq=False)
class FitScene:
    """Boxes (n) and clusters (m) of a frame."""

    boxes: F64
    """(n, 4) x1 y1 x2 y2, pixels of the raw image."""
    whole: np.ndarray
    """(n, 4) bool, which edges belong to the object instead of the image's border."""
    outline: F64
    """(m, OUTLINE, 3) points around the hit part, widened by half a beam on both sides; ego. The first ENDS are the
    rightmost, leftmost, top and bottom points."""
    roof: F64
    """(m, 3) its highest possible point, where the next ring above would have hit; NaN if there is none."""
    foot: F64
    """(m, 3, 3) points on the road under its left, nearest and right point; ego."""
    range_m: F64
    """(m,) of the nearest point, horizontal."""
    size: tuple[int, int]
    """Width and height of the image."""
    camera: CameraCalibration | None
    """The recording's calibration; None without one."""
    t_ns: int
    """The tick."""


def fit_scene(frame: Frame, params: Params) -> FitScene | None:
    """For a frame with detections in ``raw_boxes``. None without boxes or clusters."""
    if frame.sweep is None or frame.raw_boxes is None or frame.image_size is None:
        return None
    detections = [d for d in select(frame.raw_boxes, params.detection) if d.label in VEHICLES and d.score >= MIN_SCORE]
    seen = segmentation.segment(frame.sweep, frame.ego, params, Stopwatch())
    if not detections or seen.ground is None:
        return None
    outlines = _outlines(frame.sweep, seen.points, seen.kind, seen.ground, params)
    if not outlines:
        return None
    boxes = np.array([d.bbox for d in detections], dtype=np.float64)
    width, height = frame.image_size
    whole = np.abs(boxes - [0.0, 0.0, width, height]) > BORDER_PX
    outline, roof, foot = (np.array(part) for part in zip(*outlines, strict=True))
    range_m = np.array([np.hypot(*each[1, :2]) for each in foot])
    return FitScene(boxes, whole, outline, roof, foot, range_m, frame.image_size, frame.camera, frame.t_ns)


def _outlines(
    sweep: Sweep, points: F32, kind: np.ndarray, ground: Ground, params: Params
) -> list[tuple[F64, F64, F64]]:
    """Outline, roof and foot of each cluster that may be a vehicle."""
    xyz = points[:, :3].astype(np.float64) - sweep.origin
    elevations = _ring_elevations(xyz, sweep)
    half_beam = _azimuth_step(xyz, sweep) / 2
    order = np.argsort(kind, kind="stable")
    starts = np.searchsorted(kind[order], np.arange(int(kind.max(initial=-1)) + 2))
    found = []
    for first, last in pairwise(starts):
        members = order[first:last]
        own = xyz[members]
        if len(members) < FEWEST_POINTS or not _may_be_a_vehicle(own, sweep.origin, ground):
            continue
        outline = _outline(own, half_beam) + sweep.origin
        roof = _roof(own, elevations) + sweep.origin
        if ground.above(roof[None])[0] > params.cluster.max_height_m:  # higher points were not clustered
            roof = np.full(3, np.nan)
        found.append((outline, roof, _foot(own + sweep.origin, ground)))
    return found


def _may_be_a_vehicle(own: F64, origin: Sequence[float], ground: Ground) -> bool:
    """own: (K, 3), relative to the sensor."""
    range_m = np.hypot(own[:, 0], own[:, 1])
    if own[:, 0].min() <= 0.0 or not NEAREST_M <= range_m.min() <= FARTHEST_M:
        return False
    extent = np.ptp(own[:, :2], axis=0)
    top = own[np.argmax(own[:, 2])] + origin
    return bool(np.hypot(*extent) <= LONGEST_M) and float(ground.above(top[None])[0]) >= LOWEST_M


def _outline(own: F64, half_beam: float) -> F64:
    """(OUTLINE, 3) of (K, 3) points relative to the sensor: their hull in angles, with the sides half a beam wider."""
    azimuth, range_m = np.arctan2(own[:, 1], own[:, 0]), np.hypot(own[:, 0], own[:, 1])
    middle = (azimuth.min() + azimuth.max()) / 2
    try:
        corners = ConvexHull(np.column_stack([azimuth, np.arctan2(own[:, 2], range_m)]), qhull_options="QJ").vertices
    except (QhullError, ValueError):  # all points in one ring
        corners = np.array([azimuth.argmin(), azimuth.argmax()])
    ends = np.array([azimuth.argmin(), azimuth.argmax(), own[:, 2].argmax(), own[:, 2].argmin()])
    inner = np.setdiff1d(corners, ends)
    kept = np.concatenate([ends, inner[:: -(-len(inner) // (OUTLINE - ENDS)) or 1]])
    kept = np.concatenate([kept, np.repeat(kept[:1], OUTLINE - len(kept))])
    wider = azimuth[kept] + np.where(azimuth[kept] > middle, half_beam, -half_beam)
    return np.column_stack([range_m[kept] * np.cos(wider), range_m[kept] * np.sin(wider), own[kept, 2]])


def _roof(own: F64, elevations: F64) -> F64:
    """(3,) where the next ring would have hit the cluster's highest part; NaN above the topmost ring. own: (K, 3)
    relative to the sensor."""
    range_m = np.hypot(own[:, 0], own[:, 1])
    elevation = np.arctan2(own[:, 2], range_m)
    top = int(elevation.argmax())
    above = elevations[elevations > elevation[top] + np.radians(0.1)]
    if not len(above) or above[0] - elevation[top] > _WIDEST_GAP_RAD:
        return np.full(3, np.nan)
    return np.array([own[top, 0], own[top, 1], range_m[top] * np.tan(above[0])])


def _foot(own: F64, ground: Ground) -> F64:
    """(3, 3) points on the road: below the leftmost, the nearest and the rightmost of (K, 3) ego points."""
    azimuth = np.arctan2(own[:, 1], own[:, 0])
    kept = own[[int(azimuth.argmax()), int(np.hypot(own[:, 0], own[:, 1]).argmin()), int(azimuth.argmin())]].copy()
    kept[:, 2] = ground.height(kept[:, :2])
    return kept


def _ring_elevations(xyz: F64, sweep: Sweep) -> F64:
    """Elevations of the existing rings, radians, lowest first."""
    elevation = np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))
    return np.sort([np.median(elevation[sweep.ring == ring]) for ring in np.unique(sweep.ring)])


def _azimuth_step(xyz: F64, sweep: Sweep) -> float:
    """Radians between two beams of a ring."""
    ahead = xyz[:, 0] > 0.0
    azimuth, ring = np.arctan2(xyz[ahead, 1], xyz[ahead, 0]), sweep.ring[ahead]
    order = np.lexsort((azimuth, ring))
    steps = np.diff(azimuth[order])[np.diff(ring[order].astype(np.int16)) == 0]
    return float(np.median(steps)) if len(steps) else 0.0
