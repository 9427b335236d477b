"""The path along the road's edges as the LiDAR sees them (``road_structure``, ``road_shape``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from pipeline.common.geometry import F64
from pipeline.params import PathParams
from pipeline.path import road_shape, road_structure
from pipeline.path.estimates import PathEstimate
from pipeline.path.road_structure import NONE, Cells
from pipeline.types import F32, I32, U8, FusedObject, Ground, LidarTrack, Moment

_FEWEST_CELLS = 25
_ANEW_EVERY = 3
"""A shape that is followed may be the wrong one: so often it is looked for anew, which takes as long again."""


class Surroundings(NamedTuple):
    """What the stages before found in a frame."""

    points: F32
    kind: I32
    ring: U8 | None
    ground: Ground | None
    tracks: tuple[LidarTrack, ...]
    objects: tuple[FusedObject, ...]


@dataclass(frozen=True, eq=False)
class EdgeState:
    """What one frame leaves to the next."""

    cells: Cells = NONE
    """Structure beside the road."""
    shape: F64 | None = None
    """(K, 2) the road's shape in that frame."""
    since: int = 0
    """Frames since it was looked for as if nothing were known."""


class Edges(NamedTuple):
    """The road by its edges."""

    path: PathEstimate
    cells: F64
    """(M, 2) the structure that it was taken from."""


def follow(state: EdgeState, around: Surroundings, now: Moment, params: PathParams) -> tuple[EdgeState, Edges | None]:
    """One frame. None without own motion, which places earlier sweeps, and where too little stands beside the road."""
    ego = now.ego
    if ego is None or not params.use_edges:
        return EdgeState(), None
    dt_s = now.dt_s
    before = road_structure.moved(state.cells, ego, dt_s) if dt_s else NONE
    fresh = NONE
    if around.ground is not None and around.ring is not None and around.ground.fitted.any():
        cluster_of = {track.id: track.obstacle.cluster for track in around.tracks if not track.carried}
        fresh = road_structure.seen(
            around.points,
            around.kind,
            around.ring,
            around.ground,
            road_structure.long(around.objects, cluster_of),
        )
    driving = [item for item in around.objects if road_structure.drives(item)]
    fresh, before = road_structure.without(fresh, driving), road_structure.without(before, driving)
    cells = road_structure.merged(before, fresh)
    if len(cells.xy) < _FEWEST_CELLS:
        return EdgeState(cells, None), None
    starts = road_shape.begin(state.shape, ego, dt_s, state.since == 0, params)
    center, sigma = road_shape.fitted(cells.xy, cells.blocks, starts, ego, params)
    since = (state.since + 1) % _ANEW_EVERY
    return EdgeState(cells, center, since), Edges(PathEstimate("edges", center, sigma), cells.xy)
