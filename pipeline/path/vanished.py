"""Which structure of earlier sweeps is no longer there: it stood where a vehicle drove past.

A car that crosses, or a lead that drives on, leaves a trail of cells across the lane, around which no road leads. The
next sweeps show that nothing stands there: the rays that would have to end at a cell come back from farther away
(dynamic objects are removed from maps by ray casting in the same way: Pomerleau et al., ICRA 2014). A ray without a
return says nothing: hedges and dark paint swallow some. In simulated streets without any traffic, removing cells for
that raised the path's error at 30 m from 0.39 to 0.54 m.
"""

from __future__ import annotations

import numba
import numpy as np

from pipeline.common.geometry import F64
from pipeline.common.made_sweep import made_sweep
from pipeline.types import F32, U8
from pipeline.types.arrays import Mask

_SECTORS = 360
"""Number of sectors of the half plane ahead in which a ring's nearest return is sought: 0.3° wide straight ahead, 0.6°
to the side, one to three rays of a VLP-16."""
_BELOW_M, _ABOVE_M = 0.5, 0.1
"""A ray meets a cell if it passes at most this much below or above the return that made it. What stands beside a road
stands on the ground, but a higher ray may pass over it; the car's pitch moves rays by 0.1 m at 30 m."""
_LOWEST_M = 0.3
"""Height above the road below which there is air under a car."""
_BEYOND_M = 3.0
"""A return farther behind a cell than this is not from the same structure. Along a hedge 3 m beside the car, rays a
quarter of a metre aside end 2 m farther at a distance of 25 m."""
_BEFORE_M = 1.0
"""A return farther before a cell than this may hide it."""
_FEWEST_RAYS = 2
"""Sectors of rings in which nothing ended at a cell, for it to be gone: a single one may have missed its corner."""
_LIVE = 5
"""Fewest returns of a ring ahead from which its elevation is known."""


def is_gone(
    xy: F64, z_m: F64, points: F32, ring: U8, origin: tuple[float, float, float], height_m: float, cell_m: float
) -> Mask:
    """(M,) whether rays of this sweep passed through each cell and none ended there.

    Args:
        xy: (M, 2) cells, ego x y.
        z_m: (M,) ego z of the return that each was made of; one of NaN stays.
        points: (N, 4) of the sweep.
        ring: (N,) the channel of each point.
        origin: ego x y z of the sensor.
        height_m: of the sensor above the road.
        cell_m: width of a cell.
    """
    if not len(xy) or not len(points):
        return np.zeros(len(xy), np.bool_)
    gone: Mask = _gone(
        xy, z_m, points, ring, np.array(origin), origin[2] - height_m + _LOWEST_M, 0.5 * cell_m,
        _SECTORS, _BELOW_M, _ABOVE_M, _BEFORE_M, _BEYOND_M, _FEWEST_RAYS, _LIVE,
    )  # fmt: skip
    return gone


def warm_up() -> None:
    """Compile the kernel, or load it from numba's cache."""
    points, ring = made_sweep()
    is_gone(np.ones((1, 2)), np.zeros(1), points, ring, (0.0, 0.0, 0.0), 1.0, 0.5)


@numba.njit(cache=True, nogil=True)
def _gone(  # type: ignore[no-untyped-def]
    xy, z, points, ring, origin, lowest_z, half_m, sectors, below_m, above_m, before_m, beyond_m, fewest, live
):  # pragma: no cover
    """Nearest return of each ring in each sector of the half plane ahead, then every cell against the sectors and rings
    that meet it."""
    rings = int(ring.max()) + 1
    nearest = np.full((sectors, rings), np.inf)
    total, count = np.zeros(rings), np.zeros(rings)
    for i in range(len(points)):
        x, y = points[i, 0] - origin[0], points[i, 1] - origin[1]
        if x <= 0.0:
            continue
        r = np.sqrt(x * x + y * y)
        k = _sector(x, y, sectors)
        nearest[k, ring[i]] = min(nearest[k, ring[i]], r)
        total[ring[i]] += (points[i, 2] - origin[2]) / r
        count[ring[i]] += 1.0
    out = np.zeros(len(xy), np.bool_)
    for n in range(len(xy)):
        x, y = xy[n, 0] - origin[0], xy[n, 1] - origin[1]
        r = np.sqrt(x * x + y * y)
        aside_x, aside_y = -half_m * y / max(r, 1e-6), half_m * x / max(r, 1e-6)
        if r <= half_m or min(x + aside_x, x - aside_x) <= 0.0:
            continue
        first, last = _sector(x - aside_x, y - aside_y, sectors), _sector(x + aside_x, y + aside_y, sectors)
        passed, ended = 0, 0
        for c in range(rings):
            if count[c] < live:
                continue
            at_z = origin[2] + r * total[c] / count[c]
            if not max(lowest_z, z[n] - below_m) <= at_z <= z[n] + above_m:
                continue
            for k in range(first, last + 1):
                if r + beyond_m < nearest[k, c] < np.inf:
                    passed += 1
                elif r - before_m < nearest[k, c] <= r + beyond_m:
                    ended += 1
        out[n] = passed >= fewest and ended == 0
    return out


@numba.njit(cache=True, nogil=True)
def _sector(x, y, sectors):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Number of the sector of a direction ahead. y over |x| + |y| grows with the angle too, without an arctangent."""
    return min(int((y / (x + abs(y)) + 1.0) * 0.5 * sectors), sectors - 1)
