"""The path along the drivable area that a lane network finds in the image, where no lane lines or route show the road.

The area may hold one lane or the whole street, so its middle is not the ego lane's. But its two edges, kerbs or parked
cars, are parallel to the road, so the road's shape is found from them as from structure that the LiDAR sees
(``road_shape``), and the path keeps the car's present distance from them. It needs neither a LiDAR nor own motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64
from pipeline.params import PathParams
from pipeline.path import road_shape
from pipeline.path.estimates import PathEstimate, slope_error_m
from pipeline.path.ground_points import now_at
from pipeline.types import EgoState, Moment

_CELL_M, _REACH_M = 1.0, 45.0
"""Points are thinned to one per metre of road and side: near the car, a row of the image is a centimetre of road."""
_FEWEST = 15
"""Metres of edge, both sides together, below which the area says nothing of the road's course."""
_BLOCKS = 1.5
"""Log-likelihood that no road leads through an edge, as for a kerb (``road_structure``)."""
_KEPT_S = 0.5
"""Time for which the last image's path is kept: networks need not look at every image."""
_GROWS_MPS = 0.3
"""Growth of its sigma in that time."""


class DrivableArea(NamedTuple):
    """The course of the road from the drivable area."""

    path: PathEstimate
    """The path along its edges."""
    edges: F64
    """(M, 2) ego x, y of the edges."""


@dataclass(frozen=True, eq=False)
class DrivableState:
    """State from one frame to the next."""

    area: DrivableArea | None = None
    """The last image's, moved to that frame; None if it shows nothing."""
    age_s: float = 0.0
    """Time since that image."""


def follow(
    state: DrivableState, edges: F64 | None, now: Moment, params: PathParams, is_shown: bool = False
) -> tuple[DrivableState, DrivableArea | None]:
    """One frame.

    Args:
        state: after the previous frame.
        edges: (M, 2) ego x, y on the edges of the drivable area; None if this image was not looked at.
        now: time and own motion.
        params: of the path.
        is_shown: lane lines or a route already show the road, so nothing is searched.
    """
    if not params.use_drivable or is_shown:
        return DrivableState(), None
    before = _carried(state, now)
    if edges is None:
        return before, before.area
    cells = _thinned(edges)
    if len(cells) < _FEWEST:
        return DrivableState(), None
    ego = now.ego if now.ego is not None else EgoState(now.t_ns, 0.0)
    starts = road_shape.begin(before.area.path.center if before.area is not None else None, ego, None, True, params)
    shape, sigma_m = road_shape.fitted(cells, np.full(len(cells), _BLOCKS), starts, ego, params)
    path = PathEstimate("drivable_area", shape, np.hypot(sigma_m, slope_error_m(shape)))
    area = DrivableArea(path, cells)
    return DrivableState(area), area


def _carried(state: DrivableState, now: Moment) -> DrivableState:
    """The state in the current ego frame; empty if the last image is too old."""
    age_s = state.age_s + (now.dt_s or 0.0)
    if state.area is None or not now.dt_s or age_s > _KEPT_S:
        return DrivableState()
    path, edges = state.area
    if now.ego is not None:
        center = road_shape.moved_on(path.center, now.ego, now.dt_s, np.arange(len(path.center), dtype=np.float64))
        path, edges = evolve(path, center=center), now_at(edges, now.ego, now.dt_s)
    path = evolve(path, sigma_m=path.sigma_m + _GROWS_MPS * now.dt_s)
    return DrivableState(DrivableArea(path, edges), age_s)


def _thinned(edges: F64) -> F64:
    """(M, 2) the middle of the points of each metre, on either side."""
    edges = edges[(edges[:, 0] > 0.0) & (edges[:, 0] < _REACH_M)]
    cell = (edges[:, 0] / _CELL_M).astype(np.intp) * 2 + (edges[:, 1] > 0.0)
    return np.array([np.median(edges[cell == each], axis=0) for each in np.unique(cell)]).reshape(-1, 2)
