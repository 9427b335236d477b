"""Trajectories across an intersection: straight on or around a corner, for vehicles from any of its four arms."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, remainder, sin, tan
from typing import Literal

from pydantic import Field

from pipeline.simulation.world.actors import RoadUser, Speeds
from pipeline.simulation.world.lines import RoadLine, WorldPose
from pipeline.simulation.world.roads import Crossing, Road

_REACH_M = 400.0

Approach = Literal["ahead", "oncoming", "left", "right"]
Turn = Literal["left", "straight", "right"]


class CrossingActor(RoadUser, Speeds):
    """A vehicle that drives over a crossing."""

    crossing: int = Field(default=0, ge=0)
    """Index of the road's crossing, from 0."""
    approach: Approach
    """The arm it comes from, as seen from the ego vehicle (``ahead``: it drives in the ego vehicle's direction, in
    front of it)."""
    turn: Turn = "straight"
    """As seen by its own driver."""
    arrive_s: float = Field(ge=0.0, le=3600.0)
    """When its centre is halfway through its turn or, going straight, level with the crossing's centre."""
    radius_m: float = Field(default=10.0, ge=4.0, le=60.0)
    """Of its turn."""
    lane: int = Field(default=1, ge=1)
    """Counted from the middle of the road it comes on; it leaves on the innermost."""


@dataclass(frozen=True)
class CrossingWay:
    """A line in the world."""

    line: RoadLine
    """World x, y along the way."""
    arrival_m: float
    """s of the position at ``arrive_s``."""
    bend_m: tuple[float, float]
    """Start and end of the bend."""
    curvature_per_m: float
    """In the bend, positive to the left."""

    def bend(self, s_m: float) -> float:
        """Curvature at s."""
        return self.curvature_per_m if self.bend_m[0] <= s_m <= self.bend_m[1] else 0.0


def route(actor: CrossingActor, road: Road) -> CrossingWay:
    """The path an actor takes. ValueError when the road has no such crossing or lane."""
    if actor.crossing >= len(road.crossings):
        raise ValueError(f"actor {actor.id}: no crossing {actor.crossing}: the road has {len(road.crossings)}")
    crossing = road.crossings[actor.crossing]
    x, y, heading = road.to_world(crossing.s_m, 0.0)[0].tolist()
    come = _direction_rad(actor.approach, crossing)
    right_m = _lane_m(actor, road, crossing)
    if actor.turn == "straight":
        start = _behind((right_m * sin(come), -right_m * cos(come)), come, _REACH_M)
        return CrossingWay(RoadLine([(2 * _REACH_M, 0.0)], _moved(start, x, y, heading)), _REACH_M, (0.0, -1.0), 0.0)
    leave, leave_right_m = _exit(actor, road, crossing)
    turned = remainder(leave - come, 2 * pi)
    corner = _meeting((come, right_m), (leave, leave_right_m))
    tangent_m = actor.radius_m * tan(abs(turned) / 2)
    start = _behind(corner, come, _REACH_M + tangent_m)
    arc_m, curvature = actor.radius_m * abs(turned), (1.0 if turned > 0 else -1.0) / actor.radius_m
    line = RoadLine([(_REACH_M, 0.0), (arc_m, curvature), (_REACH_M, 0.0)], _moved(start, x, y, heading))
    return CrossingWay(line, _REACH_M + arc_m / 2, (_REACH_M, _REACH_M + arc_m), curvature)


def _direction_rad(approach: Approach, crossing: Crossing) -> float:
    """Direction of a vehicle from an arm; 0 is along the main road."""
    across = radians(crossing.angle_deg)
    return {"ahead": 0.0, "oncoming": pi, "right": across, "left": across + pi}[approach]


def _lane_m(actor: CrossingActor, road: Road, crossing: Crossing) -> float:
    """Offset of its lane to the right of the centre line."""
    if actor.approach in ("left", "right"):
        lanes, inner, width = crossing.lanes_each_way, 0.0, crossing.lane_width_m
    else:
        lanes = road.lanes_forward if actor.approach == "ahead" else road.lanes_oncoming
        inner, width = road.median_m / 2, road.lane_width_m
    if actor.lane > lanes:
        raise ValueError(f"actor {actor.id}: no lane {actor.lane} for {actor.approach} traffic: {lanes} there")
    return inner + (actor.lane - 0.5) * width


def _exit(actor: CrossingActor, road: Road, crossing: Crossing) -> tuple[float, float]:
    """The direction in which a turning vehicle leaves, and its offset to the right of the centre line."""
    come = _direction_rad(actor.approach, crossing)
    onto_main = actor.approach in ("left", "right")
    sign = 1.0 if actor.turn == "left" else -1.0
    arms: tuple[Approach, ...] = ("ahead", "oncoming") if onto_main else ("right", "left")
    leave = next(
        way
        for way in (_direction_rad(arm, crossing) for arm in arms)
        if sign * remainder(way - come, 2 * pi) > 0.0
    )  # fmt: skip
    if not onto_main:
        return leave, 0.5 * crossing.lane_width_m
    if leave == pi and not road.lanes_oncoming:
        raise ValueError(f"actor {actor.id}: a turn onto a carriageway that the road does not have")
    return leave, road.median_m / 2 + 0.5 * road.lane_width_m


def _meeting(one: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
    """Intersection of two lines, each (direction, metres to the right of the origin)."""
    (a, a_right), (b, b_right) = one, other
    across = sin(b - a)
    along = (b_right - a_right * cos(b - a)) / across
    return a_right * sin(a) + along * cos(a), -a_right * cos(a) + along * sin(a)


def _behind(place: tuple[float, float], direction: float, way_m: float) -> WorldPose:
    return place[0] - way_m * cos(direction), place[1] - way_m * sin(direction), direction


def _moved(pose: WorldPose, x: float, y: float, heading: float) -> WorldPose:
    """Converts a pose relative to the crossing's centre to the world."""
    c, s = cos(heading), sin(heading)
    return x + pose[0] * c - pose[1] * s, y + pose[0] * s + pose[1] * c, heading + pose[2]
