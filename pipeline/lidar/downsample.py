"""Per-channel down-sampling (paper, Point Cloud Segmentation: "down-sampling … points of each channel")."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.params import DownsampleParams
from pipeline.types import Sweep

Mask = npt.NDArray[np.bool_]


def keep_mask(sweep: Sweep, params: DownsampleParams) -> Mask:
    """(N,) bool: the first and then every ``keep_every``-th point of each channel, in the order of the sweep, without
    what is nearer than ``blind_range_m``: a bumper mount sees the car's own body.

    Counting is per channel, so every ring is thinned alike whatever order the points come in.
    """
    x, y = sweep.points[:, 0], sweep.points[:, 1]
    seen: Mask = x * x + y * y >= np.float32(params.blind_range_m**2)
    return seen & _thinned(sweep, params) if params.keep_every > 1 else seen


def _thinned(sweep: Sweep, params: DownsampleParams) -> Mask:
    count = len(sweep.ring)
    by_ring = np.argsort(sweep.ring, kind="stable")
    sorted_ring = sweep.ring[by_ring]
    place_in_ring = np.arange(count) - np.searchsorted(sorted_ring, sorted_ring, side="left")
    keep = np.empty(count, dtype=np.bool_)
    keep[by_ring] = place_in_ring % params.keep_every == 0
    return keep
