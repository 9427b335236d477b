"""Where each object is against the path: its extent across it, how surely it is in it, and when it will cross the edge.

An object is in the path when enough of its width reaches between the two edges: as much as stops a car, or half of
what is narrower. For a car that is the paper's rule, the middle of its rear between the lines; a wide truck whose
middle is outside but which leaves no room is in the path too.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, erf, sqrt
from typing import NamedTuple

import numpy as np

from pipeline.geometry import F64
from pipeline.params import CipvParams
from pipeline.path.corridor import nearest_on_path
from pipeline.path.estimates import STEP_M
from pipeline.path.yaw_rate import usable_rate
from pipeline.types import EgoState, FusedObject, Path, Point2

LIDAR_SIDEWAYS_SIGMA_M = 0.15
"""How well a cluster's sides are known: a beam's width, and what of the car was hit."""
BEARING_SIGMA_RAD = 0.005
"""How well a box's middle is known sideways (0.3°, ``vision_tracking.bearing_sigma_deg``)."""
SIDEWAYS_SIGMA_MPS = 0.5
"""What a tracked cluster's sideways speed may be off by: only what exceeds it is believed."""
CAMERA_SIDEWAYS_PER_S = 0.02
"""The same of a box, a metre of distance: it is placed by its bearing, and swings with its estimated distance."""
_SLANTED = 0.64
"""Turned by more than 20° from along or across the path, as |sin 2φ|."""
SURE = 4.0
"""Log-odds beyond which nothing gets surer: the sigmas themselves are not known that well."""


class Place(NamedTuple):
    """One object against the path. offset_m: of the middle of its nearest face, positive to the left of the centre;
    ahead_m: path length to its foot. low_m, high_m: from where to where it reaches across the path, middle_m: between
    them. left_m, right_m: how far that may lie to either side and still be in the path. sigma_m: of its sideways place
    against the path, both errors together. sideways_mps: how fast it moves to the left of the path, over ground; null
    where its velocity is not known."""

    offset_m: float
    ahead_m: float
    low_m: float
    high_m: float
    middle_m: float
    left_m: float
    right_m: float
    sigma_m: float
    sideways_mps: float | None

    @property
    def limit_m(self) -> float:
        """The limit on the side it is on."""
        return self.left_m if self.middle_m >= 0.0 else self.right_m

    def margin_m(self, extra_m: float = 0.0) -> float:
        """How far inside the path it is; negative: how far outside. extra_m widens the path."""
        return min(self.left_m + extra_m - self.middle_m, self.right_m + extra_m + self.middle_m)

    def probability(self) -> float:
        """That it is in the path, its place being normal around the measured one; 0 for what is not ahead."""
        if self.ahead_m <= 0.0:
            return 0.0
        scale = self.sigma_m * sqrt(2.0)
        return 0.5 * (erf((self.left_m - self.middle_m) / scale) + erf((self.right_m + self.middle_m) / scale))

    def log_odds(self, extra_m: float, moves_m: float) -> float:
        """What this sighting says for (positive) or against its being in the path: the log of the likelihood ratio of
        where it was seen against the nearest place on the other side of the edge, ±4 at most. moves_m: how far to the
        left it is taken to have moved on."""
        if self.ahead_m <= 0.0:
            return -SURE
        middle = self.middle_m + moves_m
        margin = min(self.left_m + extra_m - middle, self.right_m + extra_m + middle)
        surety = min(0.5 * (margin / self.sigma_m) ** 2, SURE)
        return surety if margin >= 0.0 else -surety

    def crossing_s(self, believed_mps: float, half_left_m: float, half_right_m: float) -> float | None:
        """Seconds until an object that is out of the path has its nearer side over the edge, or until one that is in it
        has left it; null when its believed sideways speed (positive to the left) leads nowhere. 0: on the edge."""
        if believed_mps == 0.0 or self.ahead_m <= 0.0:
            return None
        outwards = (self.middle_m > 0.0) == (believed_mps > 0.0)
        if outwards != (self.margin_m() >= 0.0):  # it comes to the middle of the path, or goes away beside it
            return None
        if outwards:
            way = self.margin_m()
        else:
            way = self.low_m - half_left_m if self.middle_m > 0.0 else -half_right_m - self.high_m
        return max(way, 0.0) / abs(believed_mps)


def believed_mps(sideways_mps: float | None, item: FusedObject) -> float:
    """The part of a sideways speed that its noise does not explain."""
    if sideways_mps is None or item.moving is False:
        return 0.0
    doubt = SIDEWAYS_SIGMA_MPS + (CAMERA_SIDEWAYS_PER_S * (item.distance_m or 0.0) if item.source == "V" else 0.0)
    return copysign(max(abs(sideways_mps) - doubt, 0.0), sideways_mps)


def place(
    objects: Sequence[FusedObject], path: Path, ego: EgoState | None, params: CipvParams
) -> list[tuple[Place, float | None] | None]:
    """Each object's place with its ``crossing_s``; null where it is not known where it is."""
    known = [item for item in objects if item.bev is not None]
    if not known:
        return [None] * len(objects)
    points = _outlines(known)
    offsets, reached = (row.reshape(-1, 5) for row in nearest_on_path(path, points.reshape(-1, 2)))
    ahead = reached[:, 0]
    k = np.clip((ahead / STEP_M).astype(np.intp), 0, len(path.center) - 2)
    way = path.center[k + 1] - path.center[k]
    heading = np.arctan2(way[:, 1], way[:, 0])
    # columns 1 and 2 are the nearest face; the far corners count for what stands across the path
    offsets[:, 3:] = np.where(_stands_across(known, heading)[:, None], offsets[:, 3:], offsets[:, 1:3])
    low, high = offsets[:, 1:].min(axis=1), offsets[:, 1:].max(axis=1)
    half_left, half_right = _half_widths(path, k)
    spare = 0.5 * (high - low) - np.minimum(params.min_overlap_m, 0.5 * (high - low))
    sigma = np.hypot(path.profile_m[k] if len(path.profile_m) else 0.0, _sigmas_m(known, points[:, 0], heading))
    speeds = _sideways_mps(known, points[:, 0], heading, ego)
    columns = (
        offsets[:, 0],
        ahead,
        low,
        high,
        0.5 * (low + high),
        half_left + spare,
        half_right + spare,
        sigma,
        speeds,
    )
    placed = []
    for item, (offset, along, lowest, highest, middle, left, right, both, moves), edges in zip(
        known,
        zip(*(column.tolist() for column in columns), strict=True),
        zip(half_left.tolist(), half_right.tolist(), strict=True),
        strict=True,
    ):
        sideways_mps = moves if item.velocity_mps is not None else None
        there = Place(offset, along, lowest, highest, middle, left, right, both, sideways_mps)
        placed.append((there, there.crossing_s(believed_mps(there.sideways_mps, item), *edges)))
    following = iter(placed)
    return [next(following) if item.bev is not None else None for item in objects]


def near_face_middle(bev: tuple[Point2, Point2, Point2, Point2]) -> Point2:
    """The middle of the side that faces the ego origin: between the two nearest corners."""
    (ax, ay), (bx, by) = sorted(bev, key=lambda corner: corner[0] ** 2 + corner[1] ** 2)[:2]
    return (ax + bx) / 2, (ay + by) / 2


def _outlines(items: Sequence[FusedObject]) -> F64:
    """(N, 5, 2): the middle of the nearest face, and the four corners, nearest first."""
    corners = np.array([item.bev for item in items])
    order = np.argsort((corners**2).sum(axis=2), axis=1, kind="stable")
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    return np.concatenate([corners[:, :2].mean(axis=1, keepdims=True), corners], axis=1)


def _stands_across(items: Sequence[FusedObject], heading: F64) -> np.ndarray:
    """(N,) whether an object the LiDAR measured stands slantwise to the path, as one that turns across it does. Of what
    drives along, the nearest face says better where it is: how long it is and how it is turned are known poorly."""
    yaw = np.array([item.cuboid.yaw_rad if item.cuboid is not None else np.nan for item in items])
    with np.errstate(invalid="ignore"):
        return np.abs(np.sin(2.0 * (yaw - heading))) > _SLANTED


def _half_widths(path: Path, k: np.ndarray) -> tuple[F64, F64]:
    """Distances from the centre to either edge at points k."""
    if len(path.left) != len(path.center) or len(path.right) != len(path.center) or path.left is path.center:
        usual = np.full(len(k), path.half_width_m)
        return usual, usual
    return np.hypot(*(path.left[k] - path.center[k]).T), np.hypot(*(path.right[k] - path.center[k]).T)


def _sigmas_m(items: Sequence[FusedObject], near: F64, heading: F64) -> F64:
    """(N,) of the objects' places across the path. A wrong distance moves one along the line of sight, which in a bend
    is not the way the path goes there. near: (N, 2) middles of their nearest faces."""
    by_camera = np.array([item.source == "V" for item in items])
    carried = np.array([item.carried for item in items])
    along = np.array([item.distance_sigma_m or 0.0 for item in items])
    distance = np.maximum(np.hypot(*near.T), 0.1)
    slant = np.abs(near[:, 1] * np.cos(heading) - near[:, 0] * np.sin(heading)) / distance
    boxed = BEARING_SIGMA_RAD * distance * np.where(carried, 2.0, 1.0)
    # while a cluster is carried its sigma grows, to either side as much as ahead
    clustered = np.hypot(LIDAR_SIDEWAYS_SIGMA_M, np.where(carried, along, 0.0))
    return np.hypot(along * slant, np.where(by_camera, boxed, clustered))


def _sideways_mps(items: Sequence[FusedObject], near: F64, heading: F64, ego: EgoState | None) -> F64:
    """(N,) speeds to the left of the path, which lies still on the ground: over ground, so that a car that follows the
    bend has none; NaN where a velocity is not known. Without ego speed, relative to ego and its x axis."""
    velocity = np.array([item.velocity_mps or (np.nan, np.nan) for item in items])
    if ego is None:
        return velocity[:, 1]
    turning = usable_rate(ego) or 0.0
    vx = velocity[:, 0] + ego.speed_mps - turning * near[:, 1]
    vy = velocity[:, 1] + turning * near[:, 0]
    return np.asarray(vy * np.cos(heading) - vx * np.sin(heading))
