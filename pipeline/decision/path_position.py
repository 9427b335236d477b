"""The lateral position of each object relative to the path: its extent, its probability of being in the path, and when
it will cross the edge.

An object is in the path when enough of its width is between the two edges: as much as stops a car, or half of a
narrower object. For a car that is the paper's rule, the middle of its rear between the lines. A wide truck whose middle
is outside but which leaves no room to pass is in the path too.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, nan

import numba
import numpy as np

from pipeline.common.near_face import outlines, without_flank
from pipeline.decision.place import Place
from pipeline.fusion.vehicle_sizes import LONGEST_M
from pipeline.params import CipvParams
from pipeline.path.corridor import nearest
from pipeline.path.estimates import STEP_M
from pipeline.path.yaw_rate import usable_rate
from pipeline.types import EgoState, FusedObject, Path

LIDAR_SIDEWAYS_SIGMA_M = 0.15
"""Lateral uncertainty of a cluster: the width of a beam, and the unknown part of the car that was hit."""
BEARING_SIGMA_RAD = 0.005
"""Standard deviation of the bearing of a box's middle (0.3°, ``vision_tracking.bearing_sigma_deg``)."""
SIDEWAYS_SIGMA_MPS = 0.5
"""Error of a tracked cluster's lateral speed; only the part above it is used."""
CAMERA_SIDEWAYS_PER_S = 0.02
"""Additional error of a camera-only object, per metre of distance: its position follows from its bearing, so its
lateral position varies with the estimated distance."""
_SLANTED = 0.64
"""Rotated by more than 20° from along or across the path, as |sin 2φ|."""
_ALONG = 0.36
"""tan 20°: what the LiDAR sees drive at less than this angle to the path is not turned by more."""
_WIDEST_M = 3.2
"""Maximum extent across the path of a vehicle that drives along it, without its flank."""
_LONGEST_M = 6.0
"""Length of a car's flank that may be visible. Trucks and buses: ``LONGEST_M``."""
_CAR_LENGTH_M, _SLOWEST_MPS, _MOST_TURNED = 4.5, 5.0, 0.2
"""A car that changes lanes and is faster than the second is rotated by lateral speed over forward speed, at most by the
third; its nose is ahead by the first."""
_SURELY_RIGID = 0.5
"""``rigid_mps`` is the slower side's speed minus two standard deviations, so it is lower than that speed."""
_NO_SIDES = ((nan, nan), (nan, nan))
_GOES_ON, _BENDS = 0.3, 1.4
"""Usual and rare errors of a path without lines or a route, as shares of its sigma: most roads go on as they begin,
some bend. Maximum likelihood, with the weight ``cipv.road_goes_on``, on 1,991 points 20 to 50 m ahead on seven random
streets. Fitted without any one of them and tried on that one, it is better than one normal distribution on six, by 0.25
to 0.46 per point, and worse on one, by 0.08. On KITTI 0009, half of the errors are within 0.3 to 0.5 sigma, and 90 %
within 0.75."""


def believed_mps(sideways_mps: float | None, item: FusedObject) -> float:
    """The part of a lateral speed that is explained neither by noise nor by a footprint that grows as more of the
    object becomes visible."""
    if sideways_mps is None or item.moving is False:
        return 0.0
    doubt = SIDEWAYS_SIGMA_MPS + (CAMERA_SIDEWAYS_PER_S * (item.distance_m or 0.0) if not item.ranged else 0.0)
    return copysign(max(abs(sideways_mps) - doubt, 0.0), sideways_mps) * _rigid_share(item)


def _rigid_share(item: FusedObject) -> float:
    """Share of its lateral speed that is motion of the whole object: 1 if both sides move at half of that speed or
    more. For objects that the LiDAR does not track this is unknown, and 1 is returned."""
    if item.rigid_mps is None or item.velocity_mps is None or not item.velocity_mps[1]:
        return 1.0
    return min(max(item.rigid_mps / item.velocity_mps[1] / _SURELY_RIGID, 0.0), 1.0)


def place(
    objects: Sequence[FusedObject], path: Path, ego: EgoState | None, params: CipvParams
) -> list[tuple[Place, float | None] | None]:
    """Each object's position with its ``crossing_s``; None if its position is unknown."""
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
        np.array([each if len(each) else np.zeros(len(path.center)) for each in (path.profile_m, path.corner_m)]),
        STEP_M,
        params.min_overlap_m,
        params.use_flank,
        params.narrow_along,
        ego is not None,
        ego.speed_mps if ego is not None else 0.0,
        usable_rate(ego) or 0.0,
    ).tolist()
    placed = []
    for item, (half_left, half_right, sideways, forward, *numbers) in zip(known, rows, strict=True):
        motion = (
            (sideways, forward, believed_mps(sideways, item)) if item.velocity_mps is not None else (None, 0.0, 0.0)
        )
        there = Place._make((*numbers, *motion, params.road_goes_on if _drives_ahead(item) else 0.0))
        placed.append((there, there.crossing_s(half_left, half_right)))
    following = iter(placed)
    return [next(following) if item.bev is not None else None for item in objects]


def warm_up() -> None:
    """Compile the kernel before the first frame."""
    center = np.column_stack([np.arange(3.0), np.zeros(3)])
    _against(np.zeros((1, 21)), center, center, center, 1.5, np.zeros((2, 3)), STEP_M, 0.9, True, True, True, 0.0, 0.0)


def _numbers(item: FusedObject) -> tuple[float, ...]:
    """One row for ``_against``: the four corners x y, yaw, velocity x y, sigma of the distance, whether only the camera
    sees it, whether it is carried, ``box_sides``, share of its lateral speed that is motion of the whole object, length
    of the flank that may be visible, whether it drives where the road goes. NaN if unknown."""
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
        _flank_m(item),
        _drives_ahead(item),
    )


def _drives_ahead(item: FusedObject) -> bool:
    """Whether it drives where the road goes."""
    return item.imaged and bool(item.surely_moving) and not item.oncoming


def _flank_m(item: FusedObject) -> float:
    """Longest flank that an object may show if it drives along the path."""
    return LONGEST_M[item.label] if item.label in ("truck", "bus") else _LONGEST_M


@numba.njit(cache=True, nogil=True)
def _against(  # type: ignore[no-untyped-def]
    rows, center, left, right, half_width, sigmas, step, overlap, use_flank, narrow_along, ego_known, speed, yaw_rate
):
    """(N, 14) from (N, 21) rows of ``_numbers``: distances from the centre to the left and to the right edge at the
    object, speed to the left of the path and along it, then the fields of ``Place`` up to ``rare_m``. half_width: for
    a path without edges, else 0. sigmas: (2, K) ``profile_m`` and ``corner_m`` of the path."""
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
            edges[n, k] = edge if np.isfinite(edge) else 0.0  # the kernel below assumes no NaN
    beside, _ = nearest(center, edges)
    out = np.empty((len(rows), 14))
    for n in range(len(rows)):
        offsets, ahead = aside[5 * n : 5 * n + 5], reached[5 * n]
        near_x, near_y = corners[5 * n, 0], corners[5 * n, 1]
        k = min(max(int(ahead / step), 0), len(center) - 2)
        heading = headings[n]
        cos, sin = np.cos(heading), np.sin(heading)
        has_sides = np.isfinite(rows[n, 14:18]).all()
        flank = rows[n, 19] * abs(near_y * cos - near_x * sin) / max(np.hypot(near_x, near_y), 0.1)
        vx, vy = rows[n, 9], rows[n, 10]
        # the path is fixed to the ground, so an object that follows its bend does not move sideways relative to it;
        # without own speed, relative to ego and its x axis
        along, across = vx + speed - yaw_rate * near_y, vy + yaw_rate * near_x
        sideways = across * cos - along * sin if ego_known else vy
        forward = along * cos + across * sin
        drives_along = abs(forward) > _SLOWEST_MPS and abs(sideways) < _ALONG * abs(forward)
        if narrow_along and ego_known and not rows[n, 12] and drives_along:
            has_sides = False  # a box wider than what drives along the path shows other vehicles as well
        low, high = _reach(offsets, has_sides, beside[2 * n], beside[2 * n + 1], flank, rows[n, 8] - heading)
        if ego_known and forward > _SLOWEST_MPS:  # if it changes lanes, its nose is farther to the side than its rear
            doubt = SIDEWAYS_SIGMA_MPS + (CAMERA_SIDEWAYS_PER_S * ahead if rows[n, 12] else 0.0)
            nose = _CAR_LENGTH_M * min(max(abs(sideways) - doubt, 0.0) * rows[n, 18] / forward, _MOST_TURNED)
            low, high = (low, high + nose) if sideways > 0.0 else (low - nose, high)
        half_left = half_width + np.hypot(left[k, 0] - center[k, 0], left[k, 1] - center[k, 1])
        half_right = half_width + np.hypot(right[k, 0] - center[k, 0], right[k, 1] - center[k, 1])
        spare = 0.5 * (high - low) - min(overlap, 0.5 * (high - low))
        out[n, 0], out[n, 1], out[n, 2], out[n, 3] = half_left, half_right, sideways, forward
        out[n, 4], out[n, 5], out[n, 6], out[n, 7] = offsets[0], ahead, low, high
        out[n, 8] = 0.5 * (low + high)
        out[n, 9], out[n, 10] = half_left + spare, half_right + spare
        own = _sigma_m(near_x, near_y, cos, sin, rows[n, 11], rows[n, 12], rows[n, 13])
        turns_off = 0.0 if rows[n, 20] else sigmas[1, k]  # a vehicle that drives ahead is where the road goes
        without_path = turns_off**2 + own**2 + flanks[n] ** 2
        for field, share in ((11, 1.0), (12, _GOES_ON), (13, _BENDS)):
            out[n, field] = np.sqrt((share * sigmas[0, k]) ** 2 + without_path)
    return out


@numba.njit(cache=True, nogil=True)
def _reach(offsets, has_sides, first, second, flank, turn):  # type: ignore[no-untyped-def]
    """Minimum and maximum lateral position of an object relative to the path. offsets: (5,) of its outline. first,
    second: of its box's sides. flank: how much of the flank may be visible if it drives along the path, m. turn: of the
    object relative to the path, rad.

    For an object that drives along the path, only the nearest face is used: its length and orientation are known
    poorly. An object at an angle to the path, such as one that turns across it, extends to its far corners and to the
    sides of its camera box, because a dark flank at 30 m returns only a few points.
    """
    low, high = min(offsets[1], offsets[2]), max(offsets[1], offsets[2])
    too_wide = has_sides and abs(second - first) > _WIDEST_M + flank
    if too_wide or abs(np.sin(2.0 * turn)) > _SLANTED:
        low, high = min(low, offsets[3], offsets[4]), max(high, offsets[3], offsets[4])
        if has_sides:
            low, high = min(low, first, second), max(high, first, second)
    return low, high


@numba.njit(cache=True, nogil=True)
def _headings(center, along, step):  # type: ignore[no-untyped-def]
    """(N,) directions of the line at path lengths (N,)."""
    out = np.empty(len(along))
    for n in range(len(along)):
        k = min(max(int(along[n] / step), 0), len(center) - 2)
        out[n] = np.arctan2(center[k + 1, 1] - center[k, 1], center[k + 1, 0] - center[k, 0])
    return out


@numba.njit(cache=True, nogil=True)
def _sigma_m(near_x, near_y, cos, sin, distance_sigma, by_camera, carried):  # type: ignore[no-untyped-def]
    """Standard deviation of an object's lateral position relative to the path. A distance error moves the object along
    the line of sight, which in a bend differs from the path's direction."""
    distance = max(np.hypot(near_x, near_y), 0.1)
    slant = abs(near_y * cos - near_x * sin) / distance
    if by_camera:
        aside = BEARING_SIGMA_RAD * distance * (2.0 if carried else 1.0)
    else:  # while a cluster is carried, its sigma grows sideways as much as ahead
        aside = np.hypot(LIDAR_SIDEWAYS_SIGMA_M, distance_sigma if carried else 0.0)
    return np.hypot(distance_sigma * slant, aside)
