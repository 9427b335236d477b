"""The path along the road's edges as the LiDAR sees them (``road_structure``, ``road_shape``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.common.geometry import F64
from pipeline.params import PathParams
from pipeline.path import road_shape, road_structure
from pipeline.path.estimates import PathEstimate, samples
from pipeline.path.road_structure import NONE, Cells
from pipeline.types import F32, I32, U8, EgoState, FusedObject, Ground, LidarTrack, Moment

_FEWEST_CELLS = 25
_EVERY, _ANEW_EVERY = 1, 3
"""The shape is looked for in every frame. A shape that is followed may be the wrong
one: in every third it is looked for as if nothing were known of it, which takes as long again."""
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
    sigma_m: F64 | None = None
    """(K,) of it."""
    room_m: tuple[float, float] = (0.0, 0.0)
    """How far the corridor reaches to the left and to the right of it."""
    turn: int = 0
    """Frames so far, modulo ``_ANEW_EVERY``."""


class Edges(NamedTuple):
    """The road by its edges."""

    path: PathEstimate
    """Along them, as far from them as the car is now."""
    cells: F64
    """(M, 2) ego x, y of the structure that it was taken from."""


def follow(state: EdgeState, around: Surroundings, now: Moment, params: PathParams) -> tuple[EdgeState, Edges | None]:
    """One frame. None without own motion, which places earlier sweeps, and where too little stands beside the road."""
    ego, dt_s = now.ego, now.dt_s
    if ego is None or not params.use_edges:
        return EdgeState(), None
    # What stood beside the road in earlier sweeps, moved on by own motion; some frames only predict, to save time
    before = road_structure.moved(state.cells, ego, dt_s) if dt_s else NONE
    turn = (state.turn + 1) % _ANEW_EVERY
    if state.turn % _EVERY and dt_s and state.shape is not None and state.sigma_m is not None:
        shape = road_shape.moved_on(state.shape, ego, dt_s, samples(params.length_m))
        return _found(EdgeState(before, shape, state.sigma_m, state.room_m, turn))
    # With what this sweep sees there, but without what drives
    cells = road_structure.merged(before, _seen(around))
    driving = [item for item in around.objects if road_structure.drives(item)]
    cells = road_structure.without(cells, driving)
    if len(cells.xy) < _FEWEST_CELLS:
        return EdgeState(cells), None
    # The shape along which most of it lies at the same distance is the road's, and the nearest of it is its room
    starts = road_shape.begin(state.shape, ego, dt_s, state.turn == 0, params)
    shape, sigma_m = road_shape.fitted(cells.xy, cells.blocks, starts, ego, params)
    room_m = road_shape.room(shape, cells.xy[cells.stands], params.half_width_m)
    return _found(EdgeState(cells, shape, sigma_m, room_m, turn))


def _seen(around: Surroundings) -> Cells:
    """The cells of this sweep."""
    ground = around.ground
    if ground is None or around.ring is None or not ground.fitted.any() or not around.sensor_height_m > _LOWEST_M:
        return NONE
    cluster_of = {track.id: track.obstacle.cluster for track in around.tracks if not track.carried}
    long = road_structure.long(around.objects, cluster_of)
    return road_structure.seen(around.points, around.kind, around.ring, ground, long, around.sensor_height_m)


def _found(state: EdgeState) -> tuple[EdgeState, Edges]:
    assert state.shape is not None
    assert state.sigma_m is not None
    left_m, right_m = (np.full(len(state.shape), each) for each in state.room_m)
    return state, Edges(PathEstimate("edges", state.shape, state.sigma_m, left_m, right_m), state.cells.xy)


def warm_up() -> None:
    """Compile the kernels, or load them from numba's cache."""
    road_structure.warm_up()
    ego, params = EgoState(0, 10.0, 0.0), PathParams()
    starts = road_shape.begin(None, ego, None, True, params)
    road_shape.fitted(np.zeros((2, 2)), np.zeros(2), starts, ego, params)
