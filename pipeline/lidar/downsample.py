"""Per-channel down-sampling (paper, Point Cloud Segmentation: "down-sampling … points of each channel")."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.params import DownsampleParams
from pipeline.types import Mask, Sweep

_AHEAD_M = 0.1
"""The ego origin is the middle of the front bumper, so nothing this far ahead of it belongs to the car. The returns
nearer than a metre that Astyx's sweeps contain are all more than a metre behind it."""


def keep_mask(sweep: Sweep, params: DownsampleParams) -> Mask:
    """(N,) bool: the first and then every ``keep_every``-th point of each channel, in the order of the sweep, without
    points closer than ``blind_range_m`` that are not ahead of the bumper, since a sensor sees the car's own body.

    Points are counted per channel, so that every ring is down-sampled equally in any order of points.
    """
    seen: Mask = _beyond(sweep.points, params.blind_range_m)
    return seen & _thinned(sweep, params) if params.keep_every > 1 else seen


def _thinned(sweep: Sweep, params: DownsampleParams) -> Mask:
    count = len(sweep.ring)
    by_ring = np.argsort(sweep.ring, kind="stable")
    sorted_ring = sweep.ring[by_ring]
    place_in_ring = np.arange(count) - np.searchsorted(sorted_ring, sorted_ring, side="left")
    keep = np.empty(count, dtype=np.bool_)
    keep[by_ring] = place_in_ring % params.keep_every == 0
    return keep


@numba.njit(cache=True, nogil=True)
def _beyond(points, range_m):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(N,) bool: points at least this far away, horizontally, or ahead of the bumper."""
    far, limit2 = np.empty(len(points), dtype=np.bool_), np.float32(range_m * range_m)
    ahead = np.float32(_AHEAD_M)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        far[i] = (x * x + y * y >= limit2) | (x >= ahead)
    return far
