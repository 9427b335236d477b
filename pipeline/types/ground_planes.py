"""Heights over a ground of several planes, as compiled loops: whole sweeps need them several times a frame."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.common.made_sweep import made_sweep


@numba.njit(cache=True, nogil=True)
def segment_of(edges, x):  # type: ignore[no-untyped-def]
    """The segment that a place along x (m) lies in. edges: (S + 1,) bounds of the segments; the outer ones extend
    beyond theirs."""
    found = 0
    while found < len(edges) - 2 and edges[found + 1] <= x:
        found += 1
    return found


@numba.njit(cache=True, nogil=True)
def height_above(planes, edges, x, y, z):  # type: ignore[no-untyped-def]
    """Height in metres of a point over the plane of its segment, along the plane's normal. planes: (S, 4)
    ``nx ny nz d``."""
    plane = planes[segment_of(edges, x)]
    return plane[0] * x + plane[1] * y + plane[2] * z + plane[3]


@numba.njit(cache=True, nogil=True)
def ground_z(planes, edges, x, y):  # type: ignore[no-untyped-def]
    """z in metres of the ground at a place."""
    plane = planes[segment_of(edges, x)]
    return -(plane[3] + plane[0] * x + plane[1] * y) / plane[2]


@numba.njit(cache=True, nogil=True)
def heights_above(planes, edges, points):  # type: ignore[no-untyped-def]
    """(N,) ``height_above`` of points (N, 3+)."""
    out = np.empty(len(points))
    for n in range(len(points)):
        out[n] = height_above(planes, edges, points[n, 0], points[n, 1], points[n, 2])
    return out


@numba.njit(cache=True, nogil=True)
def grounds_z(planes, edges, xy):  # type: ignore[no-untyped-def]
    """(N,) ``ground_z`` at places (N, 2)."""
    out = np.empty(len(xy))
    for n in range(len(xy)):
        out[n] = ground_z(planes, edges, xy[n, 0], xy[n, 1])
    return out


def warm_up() -> None:
    """Compile the kernels, or load them from numba's cache."""
    planes, edges = np.array([[0.0, 0.0, 1.0, 0.0]]), np.array([0.0, 1.0])
    grounds_z(planes, edges, np.zeros((1, 2)))
    heights_above(planes, edges, np.zeros((1, 3)))
    points, _ = made_sweep()
    heights_above(planes, edges, points)
