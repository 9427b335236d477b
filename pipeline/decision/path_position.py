"""The lateral position of each object relative to the path: its extent, its probability of being in the path, and when
it will cross the edge.

An object is in the path when enough of its width is between the two edges: as much as stops a car, or half of a
narrower object. For a car that is the paper's rule, the middle of its rear between the lines. A wide truck whose middle
is outside but which leaves no room to pass is in the path too.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, erf, nan, sqrt
from typing import NamedTuple

import numba
import numpy as np

from pipeline.common.near_face import outlines, without_flank
from pipeline.params import CipvParams
from pipeline.path.corridor import nearest
from pipeline.path.estimates import STEP_M
from pipeline.path.yaw_rate import usable_rate
from pipeline.types import EgoState, FusedObject, Path

LIDAR_SIDEWAYS_SIGMA_M = 0.15
"""Lateral uncertainty of a cluster: the width of a beam, and which part of the car was hit."""
BEARING_SIGMA_RAD = 0.005
"""How well a box's middle is known sideways (0.3°, ``vision_tracking.bearing_sigma_deg``)."""
SIDEWAYS_SIGMA_MPS = 0.5
"""Error of a tracked cluster's sideways speed: only what exceeds it is believed."""
CAMERA_SIDEWAYS_PER_S = 0.02
"""Additional error of a camera-only object, per metre of distance: it is placed by its bearing, and swings with its
estimated distance."""
_SLANTED = 0.64
"""Turned by more than 20° from along or across the path, as |sin 2φ|."""
_WIDEST_M, _LONGEST_M = 3.2, 6.0
"""A vehicle that drives along is no wider across the path, but for as much of its flank as can be seen."""
_CAR_LENGTH_M, _SLOWEST_MPS, _MOST_TURNED = 4.5, 5.0, 0.2
"""A car that changes lanes faster than the second is turned by its sideways over its forward speed, at most the third;
its nose is this car length further on."""
_SURELY_RIGID = 0.5
"""``rigid_mps`` is what is left of the slower side's speed after two standard deviations: less than that speed."""
_NO_SIDES = ((nan, nan), (nan, nan))
_SUREST_M = 0.01
SURE = 4.0
"""Log-odds beyond which nothing gets surer: the sigmas themselves are not known that well."""


class Place(NamedTuple):
    """One object against the path. Sideways is positive to the left of the path's centre."""

    offset_m: float
    """Of the middle of its nearest face."""
    ahead_m: float
    """Path length to the foot of that point."""
    low_m: float
    """Its rightmost extent across the path."""
    high_m: float
    """Its leftmost extent across the path."""
    middle_m: float
    """Between the two."""
    left_m: float
    """How far to the left the middle may be for the object to be in the path."""
    right_m: float
    """The same to the right."""
    sigma_m: float
    """Standard deviation of its sideways position against the path, with the errors of both."""
    sideways_mps: float | None
    """Speed to the left of the path, over ground; None where its velocity is not known."""

    @property
    def limit_m(self) -> float:
        """``left_m`` or ``right_m``, on the side where it is."""
        return self.left_m if self.middle_m >= 0.0 else self.right_m

    def margin_m(self, extra_m: float = 0.0) -> float:
        """How far inside the path it is; negative: outside. extra_m widens the path."""
        return min(self.left_m + extra_m - self.middle_m, self.right_m + extra_m + self.middle_m)

    def probability(self, extra_m: float = 0.0) -> float:
        """That it is in the path, its position being normal around where it was measured. Unlike ``log_odds``, which
        asks on which side of an edge it lies, this falls below a half when the path is known less well than it is wide.
        """
        left_m, right_m = self.left_m + extra_m - self.middle_m, self.right_m + extra_m + self.middle_m
        scale = 1.0 / (max(self.sigma_m, _SUREST_M) * sqrt(2.0))
        return max(0.0, 0.5 * (erf(left_m * scale) + erf(right_m * scale)))

    def log_odds(self, extra_m: float, moves_m: float) -> float:
        """Log-odds of this sighting that the object is in the path: the log-likelihood ratio of its position against
        the nearest one on the other side of the edge, at most ±4. moves_m: distance to the left that the object is
        assumed to have moved on."""
        if self.ahead_m <= 0.0:
            return -SURE
        middle = self.middle_m + moves_m
        margin = min(self.left_m + extra_m - middle, self.right_m + extra_m + middle)
        surety = min(0.5 * (margin / self.sigma_m) ** 2, SURE)
        return surety if margin >= 0.0 else -surety

    def crossing_s(self, believed_mps: float, half_left_m: float, half_right_m: float) -> float | None:
        """Seconds until the nearer side of an object outside of the path crosses the edge, or until one inside has
        left; None when its believed sideways speed (positive to the left) leads to neither. 0: on the edge."""
        if believed_mps == 0.0 or self.ahead_m <= 0.0:
            return None
        outwards = (self.middle_m > 0.0) == (believed_mps > 0.0)
        if outwards != (self.margin_m() >= 0.0):  # it moves within the path towards its middle, or away from the path
            return None
        if outwards:
            way = self.margin_m()
        else:
            way = self.low_m - half_left_m if self.middle_m > 0.0 else -half_right_m - self.high_m
        return max(way, 0.0) / abs(believed_mps)


def believed_mps(sideways_mps: float | None, item: FusedObject) -> float:
    """The part of a sideways speed that neither noise explains nor a footprint that grows as more of it comes into
    view."""
    if sideways_mps is None or item.moving is False:
        return 0.0
    doubt = SIDEWAYS_SIGMA_MPS + (CAMERA_SIDEWAYS_PER_S * (item.distance_m or 0.0) if not item.ranged else 0.0)
    return copysign(max(abs(sideways_mps) - doubt, 0.0), sideways_mps) * _rigid_share(item)


def _rigid_share(item: FusedObject) -> float:
    """How much of its sideways speed is motion of the whole object: all of it where both sides surely move by half of
    it or more. Nothing is known of what the LiDAR does not follow."""
    if item.rigid_mps is None or item.velocity_mps is None or not item.velocity_mps[1]:
        return 1.0
    return min(max(item.rigid_mps / item.velocity_mps[1] / _SURELY_RIGID, 0.0), 1.0)


def place(
    objects: Sequence[FusedObject], path: Path, ego: EgoState | None, params: CipvParams
) -> list[tuple[Place, float | None] | None]:
    """Each object's place with its ``crossing_s``; None where its position is unknown."""
    known = [item for item in objects if item.bev is not None]
    if not known:
        return [None] * len(objects)
    has_edges = len(path.left) == len(path.right) == len(path.center) and path.left is not path.center
    rows = _against(
        np.array([_numbers(item) for item in known]),
        path.center,
        path.left if has_edges else path.center,
        path.right if has_edges else path.center,
        0.0 if has_edges else path.half_width_m,
        path.profile_m if len(path.profile_m) else np.zeros(len(path.center)),
        STEP_M,
        params.min_overlap_m,
        params.use_flank,
        ego is not None,
        ego.speed_mps if ego is not None else 0.0,
        usable_rate(ego) or 0.0,
    ).tolist()
    placed = []
    for item, (half_left, half_right, sideways, *numbers) in zip(known, rows, strict=True):
        there = Place._make((*numbers, sideways if item.velocity_mps is not None else None))
        placed.append((there, there.crossing_s(believed_mps(there.sideways_mps, item), half_left, half_right)))
    following = iter(placed)
    return [next(following) if item.bev is not None else None for item in objects]


def warm_up() -> None:
    """Compile the kernel before the first frame."""
    center = np.column_stack([np.arange(3.0), np.zeros(3)])
    _against(np.zeros((1, 19)), center, center, center, 1.5, np.zeros(3), STEP_M, 0.9, True, True, 0.0, 0.0)


def _numbers(item: FusedObject) -> tuple[float, ...]:
    """One row for ``_against``: the four corners x y, yaw, velocity x y, sigma of the distance, whether only the camera
    has it, whether it is carried, ``box_sides``, how much of its sideways speed is its own. NaN where unknown."""
    a, b, c, d = item.bev  # type: ignore[misc]
    e, f = item.box_sides if item.box_sides is not None else _NO_SIDES
    yaw_rad = item.cuboid.yaw_rad if item.cuboid is not None else nan
    velocity = item.velocity_mps if item.velocity_mps is not None else (nan, nan)
    return (
        *a,
        *b,
        *c,
        *d,
        yaw_rad,
        *velocity,
        item.distance_sigma_m or 0.0,
        not item.ranged,
        item.carried,
        *e,
        *f,
        _rigid_share(item),
    )


@numba.njit(cache=True, nogil=True)
def _against(rows, center, left, right, half_width, profile, step, overlap, use_flank, ego_known, speed, yaw_rate):  # type: ignore[no-untyped-def]
    """(N, 11) of (N, 19) rows as ``_numbers`` gives them: distances from the centre to the left and to the right edge
    there, sideways speed, then the numbers of ``Place`` as far as ``sigma_m``. half_width: of a path that has no edges
    of its own, else 0."""
    middles = np.empty((len(rows), 2))
    for n in range(len(rows)):
        for k in range(2):
            middles[n, k] = 0.25 * (rows[n, k] + rows[n, 2 + k] + rows[n, 4 + k] + rows[n, 6 + k])
    along_path = _headings(center, nearest(center, middles)[1], step)
    flanks = np.zeros(len(rows))
    for n in range(len(rows)):
        if use_flank and rows[n, 12]:
            flanks[n] = without_flank(rows[n], along_path[n])
    corners = outlines(rows, along_path)
    aside, reached = nearest(center, corners)
    headings = _headings(center, reached[::5], step)
    edges = np.zeros((2 * len(rows), 2))
    for n in range(len(edges)):
        for k in range(2):
            edge = rows[n // 2, 14 + 2 * (n % 2) + k]
            edges[n, k] = edge if np.isfinite(edge) else 0.0  # the kernel below is told that nothing is NaN
    beside, _ = nearest(center, edges)
    out = np.empty((len(rows), 11))
    for n in range(len(rows)):
        offsets, ahead = aside[5 * n : 5 * n + 5], reached[5 * n]
        near_x, near_y = corners[5 * n, 0], corners[5 * n, 1]
        k = min(max(int(ahead / step), 0), len(center) - 2)
        heading = headings[n]
        cos, sin = np.cos(heading), np.sin(heading)
        has_sides = np.isfinite(rows[n, 14:18]).all()
        flank = _LONGEST_M * abs(near_y * cos - near_x * sin) / max(np.hypot(near_x, near_y), 0.1)
        low, high = _reach(offsets, has_sides, beside[2 * n], beside[2 * n + 1], flank, rows[n, 8] - heading)
        vx, vy = rows[n, 9], rows[n, 10]
        # the path lies still on the ground: over ground one that follows its bend does not move sideways; where the own
        # speed is not known, relative to ego and its x axis
        along, across = vx + speed - yaw_rate * near_y, vy + yaw_rate * near_x
        sideways = across * cos - along * sin if ego_known else vy
        forward = along * cos + across * sin
        if ego_known and forward > _SLOWEST_MPS:  # the nose of one that moves over is farther that way than its rear
            doubt = SIDEWAYS_SIGMA_MPS + (CAMERA_SIDEWAYS_PER_S * ahead if rows[n, 12] else 0.0)
            nose = _CAR_LENGTH_M * min(max(abs(sideways) - doubt, 0.0) * rows[n, 18] / forward, _MOST_TURNED)
            low, high = (low, high + nose) if sideways > 0.0 else (low - nose, high)
        half_left = half_width + np.hypot(left[k, 0] - center[k, 0], left[k, 1] - center[k, 1])
        half_right = half_width + np.hypot(right[k, 0] - center[k, 0], right[k, 1] - center[k, 1])
        spare = 0.5 * (high - low) - min(overlap, 0.5 * (high - low))
        out[n, 0], out[n, 1], out[n, 2] = half_left, half_right, sideways
        out[n, 3], out[n, 4], out[n, 5], out[n, 6] = offsets[0], ahead, low, high
        out[n, 7] = 0.5 * (low + high)
        out[n, 8], out[n, 9] = half_left + spare, half_right + spare
        own = _sigma_m(near_x, near_y, cos, sin, rows[n, 11], rows[n, 12], rows[n, 13])
        out[n, 10] = np.sqrt(profile[k] ** 2 + own**2 + flanks[n] ** 2)
    return out


@numba.njit(cache=True, nogil=True)
def _reach(offsets, has_sides, first, second, flank, turn):  # type: ignore[no-untyped-def]
    """From where to where an object reaches across the path. offsets: (5,) of its outline. first, second: of its box's
    sides. flank: how much of one that drives along may show, m. turn: of the object against the path, rad.

    Of what drives along, the nearest face says where it is: how long it is and how it is turned are known poorly. What
    stands slantwise to the path, as one that turns across it does, reaches as far as its far corners, and as its box
    does: of a dark flank at 30 m a few points come back."""
    low, high = min(offsets[1], offsets[2]), max(offsets[1], offsets[2])
    too_wide = has_sides and abs(second - first) > _WIDEST_M + flank
    if too_wide or abs(np.sin(2.0 * turn)) > _SLANTED:
        low, high = min(low, offsets[3], offsets[4]), max(high, offsets[3], offsets[4])
        if has_sides:
            low, high = min(low, first, second), max(high, first, second)
    return low, high


@numba.njit(cache=True, nogil=True)
def _headings(center, along, step):  # type: ignore[no-untyped-def]
    """(N,) directions of a line at path lengths (N,)."""
    out = np.empty(len(along))
    for n in range(len(along)):
        k = min(max(int(along[n] / step), 0), len(center) - 2)
        out[n] = np.arctan2(center[k + 1, 1] - center[k, 1], center[k + 1, 0] - center[k, 0])
    return out


@numba.njit(cache=True, nogil=True)
def _sigma_m(near_x, near_y, cos, sin, distance_sigma, by_camera, carried):  # type: ignore[no-untyped-def]
    """Of an object's place across the path. A wrong distance moves it along the line of sight, which in a bend is not
    the way the path goes there."""
    distance = max(np.hypot(near_x, near_y), 0.1)
    slant = abs(near_y * cos - near_x * sin) / distance
    if by_camera:
        aside = BEARING_SIGMA_RAD * distance * (2.0 if carried else 1.0)
    else:  # while a cluster is carried its sigma grows, to either side as much as ahead
        aside = np.hypot(LIDAR_SIDEWAYS_SIGMA_M, distance_sigma if carried else 0.0)
    return np.hypot(distance_sigma * slant, aside)
