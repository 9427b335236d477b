"""Which side of a footprint faces the car, and which side of a vehicle is the rear of what its image box shows."""

from __future__ import annotations

from math import atan2

import numba
import numpy as np

_Point = tuple[float, float]
_TOO_NEAR_M, _FLANK_SIGMA = 1.0, 0.5
"""Closer than the first, boxes are cut by the image's edges. The second is the standard deviation of the shift by a
flank, as a share of the shift."""


def near_face_middle(bev: tuple[_Point, _Point, _Point, _Point]) -> _Point:
    """Middle of the side that faces the ego origin: of the two sides at the nearest corner, the one more perpendicular
    to the line of sight. (Simply connecting the two nearest corners would select a short side of a cluster that is a
    thin slice of a rear.)"""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = bev
    sight = np.array([atan2(ay + by + cy + dy, ax + bx + cx + dx)])
    x, y = outlines(np.array([[ax, ay, bx, by, cx, cy, dx, dy]]), sight)[0].tolist()
    return x, y


@numba.njit(cache=True, nogil=True)
def outlines(rows, along):  # type: ignore[no-untyped-def]
    """(5·N, 2): for each row, the middle of the side that faces the ego origin, then the corners in order around the
    outline, starting with that side. The side is the one at the nearest corner that is more perpendicular to the
    direction ``along`` (N,)."""
    found = np.empty((5 * len(rows), 2))
    for n in range(len(rows)):
        near = 0
        for c in range(1, 4):
            x, y = rows[n, 2 * c], rows[n, 2 * c + 1]
            if x * x + y * y < rows[n, 2 * near] ** 2 + rows[n, 2 * near + 1] ** 2:
                near = c
        after, before = (
            _square(rows[n], near, (near + 1) % 4, along[n]),
            _square(rows[n], near, (near + 3) % 4, along[n]),
        )
        way = 1 if after >= before else 3
        for c in range(4):
            k = (near + way * c) % 4
            found[5 * n + 1 + c, 0], found[5 * n + 1 + c, 1] = rows[n, 2 * k], rows[n, 2 * k + 1]
        found[5 * n, 0] = 0.5 * (found[5 * n + 1, 0] + found[5 * n + 2, 0])
        found[5 * n, 1] = 0.5 * (found[5 * n + 1, 1] + found[5 * n + 2, 1])
    return found


@numba.njit(cache=True, nogil=True)
def without_flank(row, heading):  # type: ignore[no-untyped-def]
    """Moves a footprint that the camera placed by the middle of its box to the position of its rear, and returns the
    uncertainty of this shift.

    The box of a vehicle that faces along the path but is not straight ahead shows its rear and a flank. Its middle is
    offset from the middle of the rear by half the width that the flank adds, always towards the path in front of us.
    """
    x, y = 0.5 * (row[4] + row[6]), 0.5 * (row[5] + row[7])
    range_m, sight = np.hypot(x, y), np.arctan2(y, x)
    ahead, aside = np.cos(heading - sight), np.sin(heading - sight)
    if range_m < _TOO_NEAR_M or ahead <= 0.0:
        return 0.0
    length, width = np.hypot(row[0] - row[6], row[1] - row[7]), np.hypot(row[0] - row[2], row[1] - row[3])
    half = 0.5 * width * ahead
    flank = (half + length * abs(aside)) * range_m / (range_m + length * ahead) - half
    if flank <= 0.0:
        return 0.0
    shift = 0.5 * flank * np.sign(aside)
    for k in range(4):
        row[2 * k] += shift * np.sin(sight)
        row[2 * k + 1] -= shift * np.cos(sight)
    return _FLANK_SIGMA * abs(shift)


@numba.njit(cache=True, nogil=True)
def _square(row, a, b, along):  # type: ignore[no-untyped-def]
    """How perpendicular the side between corners a and b is to a direction: |sin| of the angle between them."""
    dx, dy = row[2 * b] - row[2 * a], row[2 * b + 1] - row[2 * a + 1]
    return abs(dy * np.cos(along) - dx * np.sin(along)) / max(np.hypot(dx, dy), 1e-9)
