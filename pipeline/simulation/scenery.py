"""Painting the ground with its markings, in flat colours that ``backdrop.Ground`` then gives grain and haze."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.simulation.canvas import Canvas
from pipeline.simulation.roads import Road
from pipeline.simulation.world import LIDAR_HEIGHT_M, World
from pipeline.types import F64

_GRASS = (66, 118, 92)
_ASPHALT, _SHOULDER, _WORN = (np.array(bgr, dtype=float) for bgr in ((88, 85, 84), (98, 95, 93), (80, 77, 76)))
_WHITE = np.array([232.0, 236.0, 236.0])
_BEHIND_M, _AHEAD_M = 4.0, 420.0
_WORN_AHEAD_M, _DASHES_AHEAD_M = 90.0, 240.0
_DASH_M, _GAP_M = 6.0, 12.0
"""Lane lines of a German motorway: 6 m of paint, 12 m without (RMS-1)."""
_DASH_ENDS = np.array([0.0, _DASH_M])
_MARK_M, _EDGE_M, _INNER_SHOULDER_M = 0.15, 0.28, 0.5
_WHEELS_M, _TRACK_M = 0.78, 0.48


_Strip = tuple[F64, F64, F64]
"""A polygon on the road: s and d of its corners, and its colour."""


def paint_ground(canvas: Canvas, road: Road, world: World, horizon: int) -> None:
    """Grass, carriageways and their markings."""
    cv2.rectangle(canvas.bgr, (0, horizon), (canvas.bgr.shape[1], canvas.bgr.shape[0]), _GRASS, cv2.FILLED)
    far = world.s_m + np.concatenate([np.arange(-_BEHIND_M, 60.0, 5.0), np.geomspace(60.0, _AHEAD_M, 16)])
    strips = [*_carriageways(road, far), *_wheel_tracks(road, far[far < world.s_m + _WORN_AHEAD_M])]
    for right, left in road.edges_m():
        strips += [_strip(far, edge - _EDGE_M / 2, edge + _EDGE_M / 2, _WHITE) for edge in (right + 0.25, left - 0.25)]
        for line in range(1, round((left - right) / road.lane_width_m)):
            strips += _dashes(world, right + line * road.lane_width_m)
    s, d = (np.concatenate([strip[i] for strip in strips]) for i in (0, 1))
    flat = world.to_ego(road.to_world(s, d))
    counts, colours = np.array([len(strip[0]) for strip in strips]), np.array([strip[2] for strip in strips])
    canvas.add(np.column_stack([flat, np.full(len(flat), -LIDAR_HEIGHT_M)]), counts, colours)


def _carriageways(road: Road, s_m: F64) -> list[_Strip]:
    strips = []
    for right, left in road.edges_m():
        outer_right = right - (road.shoulder_m if right < 0 else _INNER_SHOULDER_M)
        outer_left = left + (road.shoulder_m if left > 0 else _INNER_SHOULDER_M)
        strips += [_strip(s_m, outer_right, outer_left, _SHOULDER), _strip(s_m, right, left, _ASPHALT)]
    return strips


def _wheel_tracks(road: Road, s_m: F64) -> list[_Strip]:
    """The darker bands that wheels have worn into each lane."""
    lanes = (*range(-road.lanes_forward, 0), *range(1, road.lanes_oncoming + 1))
    middles = [road.lane_offset_m(lane) + wheel for lane in lanes for wheel in (-_WHEELS_M, _WHEELS_M)]
    return [_strip(s_m, middle - _TRACK_M / 2, middle + _TRACK_M / 2, _WORN) for middle in middles]


def _dashes(world: World, d_m: float) -> list[_Strip]:
    period = _DASH_M + _GAP_M
    first = np.floor((world.s_m - _BEHIND_M) / period) * period
    starts = np.arange(first, world.s_m + _DASHES_AHEAD_M, period)
    return [_strip(start + _DASH_ENDS, d_m - _MARK_M / 2, d_m + _MARK_M / 2, _WHITE) for start in starts]


def _strip(s_m: F64, right_m: float, left_m: float, bgr: F64) -> _Strip:
    return np.concatenate([s_m, s_m[::-1]]), np.repeat([right_m, left_m], len(s_m)), bgr
