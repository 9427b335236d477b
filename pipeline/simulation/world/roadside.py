"""Roadside items: guard rails, delineator posts, trees, buildings and sign gantries, placed by seed, and the strips
that a scenario names: kerbs, hedges and walls. They are placed in (s, d) once per scenario and looked up by s, so both
sensors see the same items."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.simulation.world.roads import Road
from pipeline.simulation.world.world_state import World
from pipeline.types import F64

ThingKind = Literal["rail", "post", "tree", "building", "gantry_leg", "gantry_sign", "kerb", "hedge", "wall"]

RAIL_LENGTH_M = 12.0
RAIL_LOW_M, RAIL_HIGH_M = 0.42, 0.75
_POST_STEP_M = 25.0
_GANTRY_STEP_M = 450.0
SIGN_LOW_M, SIGN_HIGH_M = 5.3, 7.6
STRIP_PIECE_M = 2.0
"""Strips are made of pieces of this length: in a bend of 30 m radius a piece deviates from the arc by 2 cm."""
_BY_THE_ROAD = frozenset({"rail", "post", "gantry_leg", "gantry_sign", "kerb", "hedge", "wall"})
"""These belong to the road, so only crossings displace them."""
_COURSE_STEP_M = 4.0
_CORNER_M = 5.0
_STEP_M, _OVERHEAD_M = 0.3, 3.0
"""Lower things are stepped over, and higher ones passed under."""
_LEAST_MEDIAN_M = 1.0
"""A narrower median has no room for rails or a gantry's leg."""


@dataclass(frozen=True)
class Thing:
    """An upright box beside the road."""

    kind: ThingKind
    """Defines its shape and colour."""
    s_m: float
    """Of its middle, along the road."""
    d_m: float
    """Of its middle, to the left of the reference line."""
    length_m: float
    """Along the road."""
    width_m: float
    """Across the road."""
    low_m: float
    """Of its lower side above the road."""
    high_m: float
    """Of its top above the road."""
    variant: float
    """A number from 0 to 1 that varies colour and shape."""


def place(road: Road, seed: int, start_m: float, end_m: float, kept_clear: F64 | None = None) -> tuple[Thing, ...]:
    """Everything beside the road from s = start to end, in order of s. kept_clear: (M, 3) world x, y and radius of
    circles in which nothing stands, such as where pedestrians walk. The items at a position depend on the seed and
    the start, but not on the end: each kind has its own random generator."""
    right = road.edges_m()[0][0] - road.shoulder_m
    left = road.edges_m()[-1][1] + road.shoulder_m
    things = [
        *_rails(road, start_m, end_m),
        *_posts(start_m, end_m, right, left),
        *(
            _gantries(start_m, end_m, right, max(0.0, road.lane_lines_m()[0][0] + 0.6))
            if road.median_m >= _LEAST_MEDIAN_M or not road.lanes_oncoming
            else ()
        ),
        *_trees(np.random.default_rng([seed, 1]), start_m, end_m, right, left),
        *(Thing("post", b.s_m, b.d_m, b.length_m, b.width_m, 0.0, b.high_m, 0.0) for b in road.beacons),
        *_strips(road, start_m, end_m),
        *_buildings(np.random.default_rng([seed, 1, 1]), start_m, end_m, right, left),
    ]
    return tuple(sorted(_off_the_road(things, road, start_m, end_m, kept_clear), key=lambda thing: thing.s_m))


def _off_the_road(things: list[Thing], road: Road, start_m: float, end_m: float, kept_clear: F64 | None) -> list[Thing]:
    """Without items in the way of a crossing road, of another section of the same, winding road, or in circles that are
    kept clear."""
    s_m, d_m = np.array([thing.s_m for thing in things]), np.array([thing.d_m for thing in things])
    places = road.to_world(s_m, d_m)[:, :2]
    reach_m = np.array([np.hypot(thing.length_m, thing.width_m) / 2 for thing in things])
    clear = np.ones(len(things), dtype=bool)
    if not road.line.straight:
        from scipy.spatial import cKDTree  # takes half a second to import, not needed for straight roads

        course = road.to_world(np.arange(start_m - 60.0, end_m + 60.0, _COURSE_STEP_M), 0.0)[:, :2]
        nearest_m, _ = cKDTree(course).query(places)
        own_m = np.where(np.array([thing.kind in _BY_THE_ROAD for thing in things]), np.inf, reach_m)
        widest = max(abs(edge) for pair in road.edges_m() for edge in pair) + road.shoulder_m
        clear &= (nearest_m > widest + own_m) | np.isinf(own_m)
    for crossing, line in zip(road.crossings, road.crossing_lines, strict=True):
        x, y, heading = line.to_world(0.0, 0.0)[0]
        beside = np.abs((places[:, 1] - y) * np.cos(heading) - (places[:, 0] - x) * np.sin(heading))
        clear &= beside > crossing.half_width_m() + _CORNER_M + reach_m
    if kept_clear is not None and len(things):
        x, y, radius_m = kept_clear.T
        apart_m = np.hypot(places[:, 0, None] - x, places[:, 1, None] - y)
        steps_over = np.array([thing.high_m < _STEP_M or thing.low_m > _OVERHEAD_M for thing in things])
        clear &= steps_over | (apart_m > radius_m + reach_m[:, None]).all(axis=1)
    return [thing for thing, stays in zip(things, clear, strict=True) if stays]


@dataclass(frozen=True)
class Roadside:
    """Placed items with their world poses, ready to be filtered by distance."""

    things: tuple[Thing, ...]
    """In order along the road."""
    s_m: F64
    """(N,) positions of the items along the road, for look-up."""
    poses: F64
    """(N, 3) world x, y and heading of the things."""

    @staticmethod
    def build(road: Road, seed: int, start_m: float, end_m: float, kept_clear: F64 | None = None) -> Roadside:
        """See ``place``."""
        things = place(road, seed, start_m, end_m, kept_clear)
        s_m = np.array([thing.s_m for thing in things])
        return Roadside(things, s_m, road.to_world(s_m, np.array([thing.d_m for thing in things])))

    def near(self, world: World, behind_m: float, ahead_m: float) -> list[tuple[Thing, float, float, float]]:
        """Items within reach along the road, each with its ego x, y and yaw, in order of s."""
        first, last = np.searchsorted(self.s_m, [world.s_m - behind_m, world.s_m + ahead_m])
        poses = self.poses[first:last]
        places = world.to_ego(poses)
        turns = poses[:, 2] - world.pose[2]
        return [
            (thing, float(x), float(y), float(yaw))
            for thing, (x, y), yaw in zip(self.things[first:last], places, turns, strict=True)
        ]


def _rails(road: Road, start_m: float, end_m: float) -> list[Thing]:
    """Guard rails along the median, if it is wide enough."""
    if road.median_m < _LEAST_MEDIAN_M:
        return []
    middles = np.arange(start_m, end_m, RAIL_LENGTH_M) + RAIL_LENGTH_M / 2
    inner = road.lane_lines_m()[0][0]
    sides = (inner + 0.6, inner + road.median_m - 0.6)
    return [
        Thing("rail", float(s), d, RAIL_LENGTH_M, 0.12, RAIL_LOW_M, RAIL_HIGH_M, 0.0) for s in middles for d in sides
    ]


def _strips(road: Road, start_m: float, end_m: float) -> list[Thing]:
    """Pieces of each strip; on the outside of a bend they are longer, so that no gaps open between them."""
    things = []
    for strip in road.strips:
        first, last = max(strip.from_m, start_m), min(strip.to_m, end_m)
        for s in np.arange(first + STRIP_PIECE_M / 2, last, STRIP_PIECE_M).tolist():
            length = STRIP_PIECE_M * (1.0 - road.curvature_per_m(s) * strip.d_m) + 0.1
            things.append(Thing(strip.kind, s, strip.d_m, length, strip.width_m, 0.0, strip.high_m, 0.0))
    return things


def _posts(start_m: float, end_m: float, right_m: float, left_m: float) -> list[Thing]:
    return [
        Thing("post", float(s), d, 0.1, 0.12, 0.0, 1.05, 0.0)
        for s in np.arange(start_m, end_m, _POST_STEP_M)
        for d in (right_m - 0.4, left_m + 0.4)
    ]


def _gantries(start_m: float, end_m: float, right_m: float, left_m: float) -> list[Thing]:
    """Sign gantries over the forward carriageway at intervals."""
    things = []
    first = np.ceil(start_m / _GANTRY_STEP_M) * _GANTRY_STEP_M
    for s in np.arange(first, end_m, _GANTRY_STEP_M):
        leg = right_m - 1.0
        things.append(Thing("gantry_leg", float(s), leg, 0.35, 0.35, 0.0, SIGN_HIGH_M, 0.0))
        things.append(Thing("gantry_leg", float(s), left_m, 0.35, 0.35, 0.0, SIGN_HIGH_M, 0.0))
        things.append(Thing("gantry_sign", float(s), leg / 2, 0.2, -leg * 0.8, SIGN_LOW_M, SIGN_HIGH_M, 0.0))
    return things


def _trees(rng: np.random.Generator, start_m: float, end_m: float, right_m: float, left_m: float) -> list[Thing]:
    """Two loose rows on either side, at least 6 m from the shoulder."""
    things = []
    for s in np.arange(start_m, end_m, 11.0):
        for edge, side in ((right_m, -1.0), (left_m, 1.0)):
            if rng.random() < 0.72:
                away, height, variant = rng.uniform(6.0, 24.0), rng.uniform(5.0, 10.0), rng.random()
                crown = height * rng.uniform(0.45, 0.7)
                place_s = float(s + rng.uniform(-5.0, 5.0))
                things.append(Thing("tree", place_s, edge + side * away, crown, crown, 0.0, height, float(variant)))
    return things


def _buildings(rng: np.random.Generator, start_m: float, end_m: float, right_m: float, left_m: float) -> list[Thing]:
    things = []
    for s in np.arange(start_m, end_m, 130.0):
        for edge, side in ((right_m, -1.0), (left_m, 1.0)):
            if rng.random() < 0.55:
                length, width, height = rng.uniform(18.0, 45.0), rng.uniform(12.0, 22.0), rng.uniform(6.0, 14.0)
                d = edge + side * (34.0 + rng.uniform(0.0, 18.0) + width / 2)
                place_s, variant = float(s + rng.uniform(-30.0, 30.0)), float(rng.random())
                things.append(Thing("building", place_s, float(d), length, width, 0.0, height, variant))
    return things
