"""Painting the ground and its markings in flat colours, to which ``backdrop.Ground`` then adds texture and haze."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.simulation.drawing.canvas import Canvas
from pipeline.simulation.world.lines import RoadLine
from pipeline.simulation.world.roads import Crossing, Road
from pipeline.simulation.world.world_state import LIDAR_HEIGHT_M, World
from pipeline.types import F64

_GRASS = (66, 118, 92)
_ASPHALT, _SHOULDER, _WORN = (np.array(bgr, dtype=float) for bgr in ((88, 85, 84), (98, 95, 93), (80, 77, 76)))
_WHITE = np.array([232.0, 236.0, 236.0])
_BEHIND_M, _AHEAD_M = 4.0, 420.0
_STRAIGHT_STEPS_M = np.array([-_BEHIND_M, 90.0, _AHEAD_M])
_BENT_STEPS_M = np.concatenate([np.arange(-_BEHIND_M, 50.0, 2.5), np.geomspace(50.0, _AHEAD_M, 24)])
_WORN_AHEAD_M, _DASHES_AHEAD_M = 90.0, 240.0
_DASH_M, _GAP_M = 6.0, 12.0
"""Lane lines of a German motorway: 6 m of paint, 12 m without (RMS-1)."""
_DASH_ENDS = np.array([0.0, _DASH_M])
_MARK_M, _EDGE_M, _INNER_SHOULDER_M = 0.15, 0.28, 0.5
_WHEELS_M, _TRACK_M = 0.78, 0.48


_CORNER_M = 4.0  # from the edge of the crossing road to where markings go on: room for the corners' curbs
_CROSSING_SEEN_M = 120.0
_STOP_LINE_M = 0.5
_EDGE_INSET_M = 0.25
_NO_MEDIAN_M = 0.6

_Strip = tuple[F64, F64, F64]
"""A polygon beside a line: s and d of its corners, and its colour."""


def paint_ground(canvas: Canvas, road: Road, world: World, horizon: int) -> None:
    """Grass, carriageways and their markings, crossing roads and theirs."""
    cv2.rectangle(canvas.bgr, (0, horizon), (canvas.bgr.shape[1], canvas.bgr.shape[0]), _GRASS, cv2.FILLED)
    far = world.s_m + (_STRAIGHT_STEPS_M if road.line.straight else _BENT_STEPS_M)
    crossings = [
        (crossing, line)
        for crossing, line in zip(road.crossings, road.crossing_lines, strict=True)
        if -_CROSSING_SEEN_M < crossing.s_m - world.s_m < _AHEAD_M
    ]
    open_m = [_junction(crossing, road) for crossing, _ in crossings]
    _add(
        canvas,
        world,
        road.line,
        [*_carriageways(road, far), *_wheel_tracks(road, far[far <= world.s_m + _WORN_AHEAD_M])],
    )
    for crossing, line in crossings:
        _add(canvas, world, line, _crossing(crossing, road))
    if road.painted:
        _add(canvas, world, road.line, [*_edge_lines(road, far, open_m), *_lane_lines(road, world, open_m)])


def _add(canvas: Canvas, world: World, line: RoadLine, strips: list[_Strip]) -> None:
    """Add strips along a line to the canvas."""
    s, d = (np.concatenate([strip[i] for strip in strips]) for i in (0, 1))
    flat = world.to_ego(line.to_world(s, d))
    counts, colours = np.array([len(strip[0]) for strip in strips]), np.array([strip[2] for strip in strips])
    canvas.add(np.column_stack([flat, np.full(len(flat), -LIDAR_HEIGHT_M)]), counts, colours)


def _junction(crossing: Crossing, road: Road) -> tuple[float, float]:
    """The intervals along the road in which markings are interrupted for a crossing."""
    turn = np.radians(crossing.angle_deg)
    widest = max(abs(edge) for pair in road.edges_m() for edge in pair)
    half = crossing.half_width_m() / np.sin(turn) + widest / abs(np.tan(turn)) + _CORNER_M
    return crossing.s_m - float(half), crossing.s_m + float(half)


def _crossing(crossing: Crossing, road: Road) -> list[_Strip]:
    """The crossing road: its asphalt, a corner's worth of it along the main road, and its own markings."""
    half, turn = crossing.half_width_m(), np.radians(crossing.angle_deg)
    edges = [edge for pair in road.edges_m() for edge in pair]
    room = half / abs(np.tan(turn)) + road.shoulder_m + _CORNER_M
    near, far = max(edges) / np.sin(turn) + room, -min(edges) / np.sin(turn) + room
    reach = np.array([-_CROSSING_SEEN_M, -far, near, _CROSSING_SEEN_M])
    wide = np.array([half, half + _CORNER_M, half + _CORNER_M, half])
    strips: list[_Strip] = [(np.concatenate([reach, reach[::-1]]), np.concatenate([-wide, wide[::-1]]), _ASPHALT)]
    for start, end, stop_side in ((-_CROSSING_SEEN_M, -far, -1.0), (near, _CROSSING_SEEN_M, 1.0)):
        ends = np.array([start, end])
        strips += [_strip(ends, edge - _MARK_M / 2, edge + _MARK_M / 2, _WHITE) for edge in (0.2 - half, half - 0.2)]
        strips.append(_strip(ends, -_MARK_M / 2, _MARK_M / 2, _WHITE))
        stop = end if stop_side < 0 else start
        right, left = sorted((0.0, stop_side * half))
        strips.append(_strip(stop + np.array([-_STOP_LINE_M / 2, _STOP_LINE_M / 2]), right, left, _WHITE))
    return strips


def _carriageways(road: Road, s_m: F64) -> list[_Strip]:
    strips = []
    for right, left in road.edges_m():
        outer_right = right - (road.shoulder_m if right < 0 else _INNER_SHOULDER_M)
        outer_left = left + (road.shoulder_m if left > 0 else _INNER_SHOULDER_M)
        strips += [_strip(s_m, outer_right, outer_left, _SHOULDER), _strip(s_m, right, left, _ASPHALT)]
    return strips


def _wheel_tracks(road: Road, s_m: F64) -> list[_Strip]:
    """The darker wheel tracks in each lane."""
    middles = [road.lane_offset_m(lane) + wheel for lane in road.lanes() for wheel in (-_WHEELS_M, _WHEELS_M)]
    return [_strip(s_m, middle - _TRACK_M / 2, middle + _TRACK_M / 2, _WORN) for middle in middles]


def _edge_lines(road: Road, s_m: F64, open_m: list[tuple[float, float]]) -> list[_Strip]:
    """Solid lines along both sides of each carriageway, open at junctions; none where two carriageways meet without a
    median."""
    edges = edge_paint_m(road)
    return [
        _strip(part, edge - _EDGE_M / 2, edge + _EDGE_M / 2, _WHITE) for part in _without(s_m, open_m) for edge in edges
    ]


def edge_paint_m(road: Road) -> list[float]:
    """d of the solid lines' middles: a little inside the carriageways, none in the middle of an undivided road."""
    pairs = [(right + _EDGE_INSET_M, left - _EDGE_INSET_M) for right, left in road.edges_m()]
    return [
        edge for pair in pairs for edge in pair if not (_undivided(road) and abs(edge - _middle(road)) < _NO_MEDIAN_M)
    ]


def _lane_lines(road: Road, world: World, open_m: list[tuple[float, float]]) -> list[_Strip]:
    """Dashes between lanes of one direction, and between directions where no median divides them."""
    period = _DASH_M + _GAP_M
    first = np.floor((world.s_m - _BEHIND_M) / period) * period
    starts = np.arange(first, world.s_m + _DASHES_AHEAD_M, period)
    free = [start for start in starts if not any(low < start + _DASH_M and start < high for low, high in open_m)]
    forward, oncoming = road.lane_lines_m()
    lines = [*([_middle(road)] if _undivided(road) else []), *forward[1:-1], *oncoming[1:-1]]
    return [_strip(start + _DASH_ENDS, d - _MARK_M / 2, d + _MARK_M / 2, _WHITE) for d in lines for start in free]


def _undivided(road: Road) -> bool:
    return road.lanes_oncoming > 0 and road.median_m < _NO_MEDIAN_M


def _middle(road: Road) -> float:
    """d between the two directions."""
    forward, oncoming = road.lane_lines_m()
    return (forward[0] + oncoming[0]) / 2 if oncoming else forward[0]


def _without(s_m: F64, open_m: list[tuple[float, float]]) -> list[F64]:
    """Ascending positions split into the stretches outside the open intervals."""
    parts, start = [], float(s_m[0])
    for low, high in sorted(open_m):
        parts.append((start, low))
        start = max(start, high)
    parts.append((start, float(s_m[-1])))
    return [np.array([a, *s_m[(s_m > a) & (s_m < b)], b]) for a, b in parts if b > a]


def _strip(s_m: F64, right_m: float, left_m: float, bgr: F64) -> _Strip:
    return np.concatenate([s_m, s_m[::-1]]), np.repeat([right_m, left_m], len(s_m)), bgr
