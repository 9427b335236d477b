"""The path along the road's edges as the LiDAR sees them (``road_structure``, ``road_shape``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.common.geometry import F64
from pipeline.params import PathParams
from pipeline.path import road_shape, road_structure
from pipeline.path.estimates import PathEstimate
from pipeline.path.road_structure import NONE, Cells
from pipeline.types import F32, I32, U8, EgoState, FusedObject, Ground, LidarTrack, Moment

_FEWEST_CELLS = 25
_ANEW_EVERY = 3
"""A shape that is followed may be the wrong one: in every third frame it is looked for as if nothing were known of it,
which takes as long again."""
_LOWEST_M = 0.1
"""A sensor that seems to lie lower has no road below it."""


class Surroundings(NamedTuple):
    """What the stages before found in a frame."""

    points: F32
    """(N, 4) of the sweep."""
    kind: I32
    """(N,) what each point was taken for."""
    ring: U8 | None
    """(N,) the channel of each; None without a sweep."""
    ground: Ground | None
    """The road below."""
    tracks: tuple[LidarTrack, ...]
    """Of clusters."""
    objects: tuple[FusedObject, ...]
    """With whether they move."""
    sensor_height_m: float
    """Over the road."""


@dataclass(frozen=True, eq=False)
class EdgeState:
    """What one frame leaves to the next."""

    cells: Cells = NONE
    """Structure beside the road."""
    shape: F64 | None = None
    """(K, 2) the road's shape in that frame; None where it is not known."""
    turn: int = 0
    """Frames so far, modulo ``_ANEW_EVERY``."""


class Edges(NamedTuple):
    """The road by its edges."""

    path: PathEstimate
    """Along them, as far from them as the car is now."""
    cells: F64
    """(M, 2) ego x, y of the structure that it was taken from."""


def follow(
    state: EdgeState, around: Surroundings, now: Moment, params: PathParams, is_shown: bool = False
) -> tuple[EdgeState, Edges | None]:
    """One frame. None without own motion, which places earlier sweeps, and where too little stands beside the road.

    is_shown: lane lines or a route show the road already. Then there are none either: what stands beside the road is
    collected, for when they end, but its shape, which takes most of the time, is not looked for."""
    ego, dt_s = now.ego, now.dt_s
    if ego is None or not params.use_edges:
        return EdgeState(), None
    # What stood beside the road in earlier sweeps, moved on by own motion, and what this one sees there, but without
    # what drives
    before = road_structure.moved(state.cells, ego, dt_s) if dt_s else NONE
    cells = road_structure.merged(before, _seen(around))
    driving = [item for item in around.objects if road_structure.drives(item)]
    cells = road_structure.without(cells, driving)
    if is_shown or len(cells.xy) < _FEWEST_CELLS:
        return EdgeState(cells), None
    # The shape along which most of it lies at the same distance is the road's, and the nearest of it is its room
    starts = road_shape.begin(state.shape, ego, dt_s, state.turn == 0, params)
    shape, sigma_m = road_shape.fitted(cells.xy, cells.blocks, starts, ego, params)
    room_m = road_shape.room(shape, cells.xy[cells.stands], params.half_width_m)
    left_m, right_m = (np.full(len(shape), each) for each in room_m)
    path = PathEstimate("edges", shape, sigma_m, left_m, right_m)
    return EdgeState(cells, shape, (state.turn + 1) % _ANEW_EVERY), Edges(path, cells.xy)


def _seen(around: Surroundings) -> Cells:
    """The cells of this sweep."""
    ground = around.ground
    if ground is None or around.ring is None or not ground.fitted.any() or not around.sensor_height_m > _LOWEST_M:
        return NONE
    cluster_of = {track.id: track.obstacle.cluster for track in around.tracks if not track.carried}
    long = road_structure.long(around.objects, cluster_of)
    return road_structure.seen(around.points, around.kind, around.ring, ground, long, around.sensor_height_m)


def warm_up() -> None:
    """Compile the kernels, or load them from numba's cache."""
    road_structure.warm_up()
    ego, params = EgoState(0, 10.0, 0.0), PathParams()
    starts = road_shape.begin(None, ego, None, True, params)
    road_shape.fitted(np.zeros((2, 2)), np.zeros(2), starts, ego, params)
