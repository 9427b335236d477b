"""Rigid transforms, cuboids and overlaps. Ego frame: x forward, y left, z up, metres; angles in radians."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numba
import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]

T_OPTICAL_BODY = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
"""From a camera's body axes (x forward, y left, z up; REP 103) to its optical ones (x right, y down, z forward)."""


class Cuboid(NamedTuple):
    """An upright box on the ground."""

    center: tuple[float, float, float]
    """x y z of its centre."""
    size: tuple[float, float, float]
    """Length, width, height along its own axes."""
    yaw_rad: float
    """Angle of its length axis from ego x, positive to the left."""

    def footprint(self) -> F64:
        """(4, 2) corners seen from above: front left, front right, rear right, rear left."""
        return corners_of([self])[0, :4, :2]

    def corners(self) -> F64:
        """(8, 3) corners: the footprint at the bottom, then the same four at the top."""
        return corners_of([self])[0]


CUBOID_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
"""The edges of a cuboid as pairs of ``Cuboid.corners``: bottom, top, uprights."""
_SIDES = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) / 2
"""Signs along length and width: front left, front right, rear right, rear left."""


def corners_of(cuboids: Sequence[Cuboid]) -> F64:
    """(M, 8, 3) corners of many cuboids at once, in the order of ``Cuboid.corners``."""
    numbers = np.array([(*each.center, *each.size, each.yaw_rad) for each in cuboids]).reshape(-1, 7)
    c, s = np.cos(numbers[:, 6:]), np.sin(numbers[:, 6:])
    along, across = numbers[:, 3:4] * _SIDES[:, 0], numbers[:, 4:5] * _SIDES[:, 1]
    corners = np.empty((len(numbers), 8, 3))
    corners[:, :4, 0] = corners[:, 4:, 0] = numbers[:, 0:1] + c * along - s * across
    corners[:, :4, 1] = corners[:, 4:, 1] = numbers[:, 1:2] + s * along + c * across
    half_height = numbers[:, 5:6] / 2
    corners[:, :4, 2] = numbers[:, 2:3] - half_height
    corners[:, 4:, 2] = numbers[:, 2:3] + half_height
    return corners


def transform(T: F64, points: npt.NDArray[np.floating]) -> F64:
    """Apply a (4, 4) rigid transform to (N, 3) points."""
    return np.asarray(points, dtype=np.float64) @ T[:3, :3].T + T[:3, 3]


def inverse(T: F64) -> F64:
    """Inverse of a (4, 4) rigid transform, from its transpose."""
    out = np.zeros((4, 4))
    out[:3, :3] = T[:3, :3].T
    out[:3, 3] = origin(T)
    out[3, 3] = 1.0
    return out


def origin(T: F64) -> F64:
    """(3,) the point that a (4, 4) rigid transform takes to the origin."""
    return np.asarray(-T[:3, :3].T @ T[:3, 3])


def rotation(roll_rad: float, pitch_rad: float, yaw_rad: float) -> F64:
    """(3, 3) rotation Rz(yaw) Ry(pitch) Rx(roll). Positive pitch turns x down, positive yaw turns x left."""
    angles = np.array([roll_rad, pitch_rad, yaw_rad], dtype=np.float64)
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles).tolist(), np.sin(angles).tolist()
    yawed_and_pitched = np.array([[cy * cp, -sy, cy * sp], [sy * cp, cy, sy * sp], [-sp, 0.0, cp]])
    rolled = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    return yawed_and_pitched @ rolled


def iou_matrix(a: npt.NDArray[np.floating], b: npt.NDArray[np.floating]) -> F64:
    """(n, m) intersection over union of (n, 4) and (m, 4) boxes ``x1 y1 x2 y2``. Boxes of no area overlap nothing."""
    a, b = np.asarray(a, dtype=np.float64).reshape(-1, 4), np.asarray(b, dtype=np.float64).reshape(-1, 4)
    return _iou(a, b)


def covered_share(a: npt.NDArray[np.floating], b: npt.NDArray[np.floating]) -> F64:
    """(n, m) share of each box of ``a`` that lies in each box of ``b``; (n, 4) and (m, 4) boxes ``x1 y1 x2 y2``."""
    a, b = np.asarray(a, dtype=np.float64).reshape(-1, 1, 4), np.asarray(b, dtype=np.float64).reshape(1, -1, 4)
    inter = np.clip(np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2]), 0.0, None).prod(axis=-1)
    return inter / np.maximum((a[..., 2:] - a[..., :2]).prod(axis=-1), 1e-9)


@numba.njit(cache=True, nogil=True)
def _iou(a, b):  # type: ignore[no-untyped-def]  # pragma: no cover
    out = np.zeros((len(a), len(b)))
    for i in range(len(a)):
        area_a = max(a[i, 2] - a[i, 0], 0.0) * max(a[i, 3] - a[i, 1], 0.0)
        for j in range(len(b)):
            width = min(a[i, 2], b[j, 2]) - max(a[i, 0], b[j, 0])
            height = min(a[i, 3], b[j, 3]) - max(a[i, 1], b[j, 1])
            if width > 0.0 and height > 0.0:
                inter = width * height
                area_b = max(b[j, 2] - b[j, 0], 0.0) * max(b[j, 3] - b[j, 1], 0.0)
                out[i, j] = inter / (area_a + area_b - inter)
    return out


def closest_on_polygon(corners: npt.NDArray[np.floating]) -> tuple[float, float]:
    """The point of a convex polygon's outline, (K, 2) corners in order, nearest to the origin."""
    x, y = _closest_on_polygon(np.asarray(corners, dtype=np.float64))
    return float(x), float(y)


@numba.njit(cache=True, nogil=True)
def _closest_on_polygon(corners):  # type: ignore[no-untyped-def]  # pragma: no cover
    count = len(corners)
    best2, best_x, best_y = np.inf, np.nan, np.nan
    for i in range(count):
        x, y = corners[i, 0], corners[i, 1]
        dx, dy = corners[(i + 1) % count, 0] - x, corners[(i + 1) % count, 1] - y
        t = min(max(-(x * dx + y * dy) / max(dx * dx + dy * dy, 1e-12), 0.0), 1.0)
        at_x, at_y = x + t * dx, y + t * dy
        away2 = at_x * at_x + at_y * at_y
        if away2 < best2:
            best2, best_x, best_y = away2, at_x, at_y
    return best_x, best_y
