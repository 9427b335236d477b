"""Per-channel down-sampling (paper, Point Cloud Segmentation: "down-sampling … points of each channel")."""

from __future__ import annotations

import numba
import numpy as np

from pipeline.params import DownsampleParams
from pipeline.types import Mask, Sweep


def keep_mask(sweep: Sweep, params: DownsampleParams) -> Mask:
    """(N,) bool: the first and then every ``keep_every``-th point of each channel, in the order of the sweep, without
    points closer than ``blind_range_m``, since a sensor on the bumper sees the car's own body.

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
    """(N,) bool: points at least this far away, horizontally."""
    far, limit2 = np.empty(len(points), dtype=np.bool_), np.float32(range_m * range_m)
    for i in range(len(points)):
        far[i] = points[i, 0] * points[i, 0] + points[i, 1] * points[i, 1] >= limit2
    return far
