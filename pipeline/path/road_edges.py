"""The path along the road's edges as the LiDAR sees them (``road_structure``, ``road_shape``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from pipeline.common.geometry import F64
from pipeline.params import PathParams
from pipeline.path import road_shape, road_structure
from pipeline.path.estimates import PathEstimate
from pipeline.path.road_structure import NONE, Cells
from pipeline.types import F32, I32, U8, VEHICLES, EgoState, FusedObject, Ground, LidarTrack, Moment, Point3

_FEWEST_CELLS = 25
_ANEW_EVERY = 3
"""A tracked shape may be the wrong one, so in every third frame the shape is also searched from scratch, which doubles
the time."""
_DROVE_S = 0.5
"""A vehicle that the LiDAR has seen driving for so long and that then stands is traffic, not part of the roadside. To
the camera alone, a parked car may seem to drive for as long."""
_STILL_S = 0.5
"""What surely drove this short ago still does: where the LiDAR takes over from the camera, it needs as long to know the
speed (``pipeline.decision.object_motion``). Its few first returns would be structure in our lane until then."""
_LOWEST_M = 0.1
"""Minimum sensor height above the road; a lower value means that there is no road below it."""


class Surroundings(NamedTuple):
    """Results of the earlier stages in a frame."""

    points: F32
    """(N, 4) points of the sweep."""
    kind: I32
    """(N,) classification of each point."""
    ring: U8 | None
    """(N,) the channel of each point; None without a sweep."""
    ground: Ground | None
    """The road below."""
    tracks: tuple[LidarTrack, ...]
    """LiDAR tracks of the clusters."""
    objects: tuple[FusedObject, ...]
    """All objects, including whether they move."""
    sensor_height_m: float
    """Height of the sensor above the road."""
    origin: Point3 = (0.0, 0.0, 0.0)
    """Ego x y z of the sensor."""


class Edges(NamedTuple):
    """The course of the road from its edges."""

    path: PathEstimate
    """The path along the edges, at the car's present distance from them."""
    cells: F64
    """(M, 2) ego x, y of the structure that was used."""


@dataclass(frozen=True, eq=False)
class EdgeState:
    """State from one frame to the next."""

    cells: Cells = NONE
    """Structure beside the road."""
    shape: F64 | None = None
    """(K, 2) shape of the road in that frame; None if it is not known."""
    turn: int = 0
    """Frame counter, modulo ``_ANEW_EVERY``."""
    edges: Edges | None = None
    """What was found in that frame; None if nothing was."""
    drove_s: Mapping[int, float] = field(default_factory=dict)
    """For how long the LiDAR has seen each object driving, by id."""
    driving_left_s: Mapping[int, float] = field(default_factory=dict)
    """For how long each object that surely drove still counts as driving, by id."""


def follow(
    state: EdgeState, around: Surroundings, now: Moment, params: PathParams, is_shown: bool = False
) -> tuple[EdgeState, Edges | None]:
    """One frame. None without own motion, which is needed to place earlier sweeps, and if there is too little structure
    beside the road.

    is_shown: lane lines or a route already show the road. Then the result is None as well: structure is collected for
    later, but the shape is not searched, which takes most of the time.
    """
    ego, dt_s = now.ego, now.dt_s
    if ego is None or not params.use_edges:
        return EdgeState(), None
    if now.stands and state.edges is not None:
        return state, None if is_shown else state.edges
    # Structure beside the road from earlier sweeps, moved by own motion, and from this sweep; without vehicles that
    # drive or drove here, and without the trail that they left
    before = road_structure.moved(state.cells, ego, dt_s) if dt_s else NONE
    if around.ring is not None and around.sensor_height_m > _LOWEST_M:
        before = road_structure.standing(before, around.points, around.ring, around.origin, around.sensor_height_m)
    cells = road_structure.merged(before, _seen(around))
    drove_s = _drove_s(state.drove_s, around.objects, dt_s or 0.0)
    driving_left_s = _driving_left_s(state.driving_left_s, around.objects, dt_s or 0.0)
    traffic = [item for item in around.objects if item.id in driving_left_s or _is_traffic(item, drove_s)]
    cells = road_structure.without(cells, traffic)
    used = cells if is_shown else road_structure.thinned(cells)
    if is_shown or len(used.xy) < _FEWEST_CELLS:
        return EdgeState(cells, drove_s=drove_s, driving_left_s=driving_left_s), None
    # The shape with the most structure at a constant distance is the road's, and the nearest structure limits the free
    # width
    starts = road_shape.begin(state.shape, ego, dt_s, state.turn == 0, params)
    shape, sigma_m = road_shape.fitted(used.xy, used.blocks, starts, ego, params)
    room_m = road_shape.room(shape, cells.xy[cells.stands], params.half_width_m)
    left_m, right_m = (np.full(len(shape), each) for each in room_m)
    path = PathEstimate("edges", shape, sigma_m, left_m, right_m)
    edges = Edges(path, used.xy)
    return EdgeState(cells, shape, (state.turn + 1) % _ANEW_EVERY, edges, drove_s, driving_left_s), edges


def _drove_s(before: Mapping[int, float], objects: tuple[FusedObject, ...], dt_s: float) -> Mapping[int, float]:
    return {
        item.id: before.get(item.id, 0.0) + (dt_s if item.ranged and road_structure.drives(item) else 0.0)
        for item in objects
        if item.id in before or (item.ranged and road_structure.drives(item))
    }


def _driving_left_s(before: Mapping[int, float], objects: tuple[FusedObject, ...], dt_s: float) -> Mapping[int, float]:
    """Every object that surely drives, or did until a moment ago and is a vehicle to the camera, with the time left for
    which it counts as driving."""
    left = {
        item.id: _STILL_S
        if road_structure.drives(item)
        else (before.get(item.id, 0.0) - dt_s if item.label in VEHICLES else 0.0)
        for item in objects
    }
    return {number: left_s for number, left_s in left.items() if left_s > 0.0}


def _is_traffic(item: FusedObject, drove_s: Mapping[int, float]) -> bool:
    """Whether it probably comes towards the car or, like a lead that has stopped, drove earlier. Without the camera,
    what seemed to drive may be a hedge that came into view bit by bit."""
    return road_structure.comes(item) or (item.label in VEHICLES and drove_s.get(item.id, 0.0) >= _DROVE_S)


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
