"""Polygons of trees, buildings, guard rails, posts, signs, kerbs, hedges and walls."""

from __future__ import annotations

from functools import lru_cache
from math import cos, hypot, sin

import numpy as np

from pipeline.simulation.drawing.canvas import Canvas, CanvasPoint, Colour
from pipeline.simulation.world.roadside import RAIL_HIGH_M, RAIL_LOW_M, Thing
from pipeline.simulation.world.world_state import LIDAR_HEIGHT_M
from pipeline.types import F64, I64

_GREENS = np.array([[46.0, 92.0, 60.0], [52.0, 112.0, 84.0], [44.0, 104.0, 96.0], [58.0, 98.0, 58.0]])
_TRUNK: Colour = (48, 62, 74)
_WALLS: tuple[Colour, ...] = ((170, 190, 205), (196, 200, 200), (140, 158, 182), (178, 182, 170))
_WINDOWS: Colour = (110, 96, 84)
_STEEL, _POST_STEEL, _STEEL_LIGHT, _STEEL_DARK = (150, 152, 150), (104, 106, 104), (196, 198, 196), (112, 114, 112)
_STRIPS: dict[str, Colour] = {"kerb": (168, 170, 170), "hedge": (44, 84, 52), "wall": (150, 162, 172)}
_DETAIL_M = 90.0
_STOREY_M = 3.2
_TURN, _COARSE_TURN = (np.linspace(0.0, 2 * np.pi, steps, endpoint=False) for steps in (24, 10))
_CROWN = np.array([[1.0, 0.0, 0.0, 0.78], [0.80, -0.10, 0.16, 1.0], [0.50, -0.22, 0.34, 1.24]])
"""Foliage discs: size, offset to the right and up in crown radii, brightness."""


def add_thing(canvas: Canvas, thing: Thing, x: float, y: float, yaw: float) -> None:
    """Add the polygons of an item at ego x, y with this yaw."""
    match thing.kind:
        case "tree":
            _tree(canvas, thing, x, y)
        case "building":
            _building(canvas, thing, x, y, yaw)
        case "rail":
            _rail(canvas, thing, x, y, yaw)
        case "gantry_sign":
            _sign(canvas, thing, x, y, yaw)
        case "post":
            _upright(canvas, (x, y + 0.06), (x, y - 0.06), 0.0, thing.high_m, (236, 238, 238))
            _upright(canvas, (x, y + 0.06), (x, y - 0.06), 0.72, 0.90, (40, 40, 40))
        case "gantry_leg":
            _walls(canvas, thing, x, y, yaw, _STEEL, thing.low_m, thing.high_m)
        case "kerb" | "hedge" | "wall":
            _strip(canvas, thing, x, y, yaw)


def _tree(canvas: Canvas, thing: Thing, x: float, y: float) -> None:
    """A trunk and overlapping foliage discs, the upper ones lighter; all face the ego axis."""
    points, counts, colours = _tree_shape(thing, hypot(x, y) < _DETAIL_M)
    canvas.add(points + np.array([x, y, -LIDAR_HEIGHT_M]), counts, colours)


@lru_cache(maxsize=4096)
def _tree_shape(thing: Thing, fine: bool) -> tuple[F64, I64, F64]:
    """Points from the tree's foot, corners of each polygon, colours: what ``Canvas.add`` takes."""
    radius, turn = thing.length_m / 2, _TURN if fine else _COARSE_TURN
    wave = radius * (1.0 + 0.10 * np.sin(turn * 3 + 9 * thing.variant) + 0.06 * np.sin(turn * 7 + 31 * thing.variant))
    size, right, up, light = _CROWN.T[:, :, None]
    leaves = np.zeros((len(_CROWN), len(turn), 3))
    leaves[..., 1] = -radius * right + size * wave * np.cos(turn)
    leaves[..., 2] = thing.high_m - radius + radius * up + size * wave * 1.08 * np.sin(turn)
    half, top = 0.07 * radius, thing.high_m - radius
    trunk = [[0.0, half, 0.0], [0.0, -half, 0.0], [0.0, -half, top], [0.0, half, top]]
    green = _GREENS[int(thing.variant * len(_GREENS)) % len(_GREENS)]
    counts = np.array([4, *[len(turn)] * len(_CROWN)])
    colours = np.concatenate([[_TRUNK], np.minimum(green * light, 255.0)])
    return np.concatenate([trunk, leaves.reshape(-1, 3)]), counts, colours


def _building(canvas: Canvas, thing: Thing, x: float, y: float, yaw: float) -> None:
    _walls(canvas, thing, x, y, yaw, _WALLS[int(thing.variant * len(_WALLS)) % len(_WALLS)], 0.0, thing.high_m)
    for storey in range(int(thing.high_m // _STOREY_M)):
        low = 0.9 + storey * _STOREY_M
        _walls(canvas, thing, x, y, yaw, _WINDOWS, low, low + 1.5, inset_m=1.2)


def _rail(canvas: Canvas, thing: Thing, x: float, y: float, yaw: float) -> None:
    """A W-beam on posts; a single strip when far away."""
    dx, dy = cos(yaw) * thing.length_m / 2, sin(yaw) * thing.length_m / 2
    start, end = (x - dx, y - dy), (x + dx, y + dy)
    if hypot(x, y) > _DETAIL_M:
        _upright(canvas, start, end, RAIL_LOW_M, RAIL_HIGH_M, (172, 174, 172))
        return
    for share in (-0.5, 0.5):
        post = (x + share * dx, y + share * dy)
        _upright(canvas, (post[0], post[1] + 0.05), (post[0], post[1] - 0.05), 0.0, RAIL_HIGH_M, _POST_STEEL)
    middle = (RAIL_LOW_M + RAIL_HIGH_M) / 2
    _upright(canvas, start, end, RAIL_LOW_M, middle, _STEEL)
    _upright(canvas, start, end, middle, RAIL_HIGH_M, _STEEL_LIGHT)
    _upright(canvas, start, end, middle - 0.03, middle + 0.03, _STEEL_DARK)


def _strip(canvas: Canvas, thing: Thing, x: float, y: float, yaw: float) -> None:
    """Walls, and the top where the camera looks down on it."""
    bgr = _STRIPS[thing.kind]
    _walls(canvas, thing, x, y, yaw, bgr, 0.0, thing.high_m)
    c, s = cos(yaw), sin(yaw)
    corners = [(thing.length_m / 2 * a, thing.width_m / 2 * b) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    top = tuple((x + a * c - b * s, y + a * s + b * c, thing.high_m - LIDAR_HEIGHT_M) for a, b in corners)
    canvas.add_face(top, bgr, (0.0, 0.0, 1.0))


def _sign(canvas: Canvas, thing: Thing, x: float, y: float, yaw: float) -> None:
    """A beam and two blue boards with a white rim and lines of lettering."""

    def board(from_m: float, to_m: float, low_m: float, high_m: float, bgr: Colour) -> None:
        ends = [(x - way * sin(yaw), y + way * cos(yaw)) for way in (from_m, to_m)]
        _upright(canvas, ends[0], ends[1], low_m, high_m, bgr)

    half, low, high = thing.width_m / 2, thing.low_m, thing.high_m
    board(-half * 1.3, half * 1.3, high - 0.7, high - 0.3, _STEEL)
    for start, end in ((-half, -0.2), (0.2, half)):
        board(start, end, low, high, (236, 236, 236))
        board(start + 0.08, end - 0.08, low + 0.08, high - 0.08, (158, 84, 22))
        for line, share in ((0.70, 0.62), (0.46, 0.45), (0.22, 0.52)):
            text_low = low + line * (high - low)
            left = end - 0.12 * (end - start)
            board(left - share * (end - start), left, text_low, text_low + 0.22, (232, 232, 232))


def _walls(
    canvas: Canvas,
    thing: Thing,
    x: float,
    y: float,
    yaw: float,
    bgr: Colour,
    low_m: float,
    high_m: float,
    inset_m: float = 0.0,
) -> None:
    """The visible walls of an upright box, shaded, up to ``inset_m`` from their ends."""
    c, s = cos(yaw), sin(yaw)
    half_l, half_w = thing.length_m / 2, thing.width_m / 2
    for nx, ny, reach, half in ((c, s, half_l, half_w), (-c, -s, half_l, half_w), (-s, c, half_w, half_l),
                                (s, -c, half_w, half_l)):  # fmt: skip
        fx, fy = x + nx * reach, y + ny * reach
        if fx * nx + fy * ny >= 0.0:
            continue
        ax, ay = -ny * (half - inset_m), nx * (half - inset_m)
        _upright(canvas, (fx - ax, fy - ay), (fx + ax, fy + ay), low_m, high_m, bgr, (nx, ny, 0.0))


def _upright(
    canvas: Canvas,
    start: tuple[float, float],
    end: tuple[float, float],
    low_m: float,
    high_m: float,
    bgr: Colour,
    normal: CanvasPoint = (0.0, 0.0, 0.0),
) -> None:
    """An upright quad above the line from start to end (ego x, y), between two heights above the road."""
    low, high = low_m - LIDAR_HEIGHT_M, high_m - LIDAR_HEIGHT_M
    canvas.add_face(((*start, low), (*end, low), (*end, high), (*start, high)), bgr, normal)
