"""The world at one moment, seen from the ego vehicle: where the actors are, and how the ego vehicle moves.

Ego frame: x forward, y left, z up, origin at the LiDAR, which sits level in the middle of the front bumper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, hypot, pi, remainder
from typing import TypeVar

import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.world.actors import Motion, RoadUser, motion
from pipeline.simulation.world.roads import Road
from pipeline.types import F64

FloatOrArray = TypeVar("FloatOrArray", float, F64)

LIDAR_HEIGHT_M = 0.5
_BRAKING_MPS2 = -0.4
_PARKED_BEHIND_M, _PARKED_AHEAD_M = 120.0, 250.0
"""Parked vehicles beyond this range are left out: rows of them would take most of the time, and no sensor detects them
there."""
_SLOWEST_STEER_MPS = 2.0  # below this speed a lane change is a slow drift to the side, not a turn on the spot


@dataclass(frozen=True)
class ActorState:
    """An actor at one moment, in the ego frame."""

    actor: RoadUser
    """The actor's properties."""
    cuboid: Cuboid
    """In the ego frame."""
    speed_mps: float
    """Speed over ground in its direction."""
    braking: bool
    """Whether its brake lights are on."""
    yaw_rate_radps: float
    """Its yaw rate in the world."""


@dataclass(frozen=True)
class World:
    """The world at one moment."""

    t_s: float
    """Since the scenario's start."""
    pose: tuple[float, float, float]
    """Of the ego origin: world x, y, heading."""
    s_m: float
    """Of the ego origin along the road."""
    d_m: float
    """Of the ego origin, to the left of the reference line."""
    speed_mps: float
    """Of the ego vehicle."""
    yaw_rate_radps: float
    """Of the ego vehicle, positive to the left."""
    actors: tuple[ActorState, ...]
    """Farthest first, so that nearer ones are drawn over them."""
    hump_per_m: float = 0.0
    """Vertical curvature of the road here, positive on a crest."""

    def lift_m(self, x_m: FloatOrArray) -> FloatOrArray:
        """Height of the road at this distance ahead above the plane on which the car stands."""
        return -self.hump_per_m * x_m * x_m / 2.0

    def to_ego(self, world: F64) -> F64:
        """(N, 2) world points as ego x, y."""
        x, y, heading = self.pose
        c, s = np.cos(heading), np.sin(heading)
        away = world[:, :2] - (x, y)
        return np.column_stack([away[:, 0] * c + away[:, 1] * s, away[:, 1] * c - away[:, 0] * s])


def at(scenario: Scenario, t_s: float, ego: Motion | None = None) -> World:
    """The world at time t; stateless. ``ego`` given: the ego vehicle's motion in a closed loop, else it follows the
    scenario. The others always follow their scripts."""
    own = ego if ego is not None else scenario.own_motion(t_s)
    s_m, pose = _ego_place(scenario, own)
    world = World(
        t_s,
        pose,
        s_m,
        own.d_m,
        own.speed_mps,
        _yaw_rate(own, scenario.road, s_m, 1.0),
        (),
        scenario.road.hump_per_m(s_m),
    )
    states = [*_on_the_road(scenario, world), *_crossing(scenario, world), *_free(scenario, world)]
    return replace(world, actors=tuple(sorted(states, key=lambda s: (-hypot(*s.cuboid.center[:2]), s.actor.id))))


def ego_pose(scenario: Scenario, t_s: float) -> tuple[float, float, float]:
    """World x, y and heading of the ego vehicle at time t, according to the scenario."""
    return _ego_place(scenario, scenario.own_motion(t_s))[1]


def _ego_place(scenario: Scenario, own: Motion) -> tuple[float, tuple[float, float, float]]:
    """s on the road, and the pose in the world."""
    road = scenario.road
    lane_d_m = road.lane_offset_m(scenario.ego.lane) + scenario.ego.offset_m
    s_m = road.line.advance(scenario.ego.start_m, own.travelled_m, lane_d_m)
    x, y, road_heading = road.to_world(s_m, own.d_m)[0].tolist()
    return s_m, (x, y, road_heading + _drift_rad(own))


def _on_the_road(scenario: Scenario, world: World) -> list[ActorState]:
    """The actors that follow lanes."""
    return [*_parked(scenario, world), *_driving(scenario, world)]


def _parked(scenario: Scenario, world: World) -> list[ActorState]:
    actors, s_m, poses = scenario.parked
    near = np.flatnonzero((s_m > world.s_m - _PARKED_BEHIND_M) & (s_m < world.s_m + _PARKED_AHEAD_M))
    places = world.to_ego(poses[near]).tolist()
    headings = poses[near, 2].tolist()
    return [
        _placed(world, actors[n], x, y, heading, 0.0, 0.0, 0.0)
        for n, (x, y), heading in zip(near.tolist(), places, headings, strict=True)
    ]


def _driving(scenario: Scenario, world: World) -> list[ActorState]:
    """A vehicle that drives against the road is rotated by half a turn, and its drift to the road's left is to its
    driver's right."""
    road, actors = scenario.road, scenario.driving
    if not actors:
        return []
    motions = [motion(actor, road, world.t_s) for actor in actors]
    start_m = scenario.ego.start_m
    s_m = [actor.place_m(road, start_m, now.travelled_m) for actor, now in zip(actors, motions, strict=True)]
    poses = road.to_world(np.array(s_m), np.array([now.d_m for now in motions]))
    places = world.to_ego(poses).tolist()
    states = []
    for actor, now, s, (x, y), road_heading in zip(actors, motions, s_m, places, poses[:, 2].tolist(), strict=True):
        way = actor.direction()
        heading = road_heading + way * _drift_rad(now) + (pi if way < 0.0 else 0.0)
        yaw_rate = _yaw_rate(now, road, s, way)
        states.append(_placed(world, actor, x, y, heading, now.speed_mps, now.accel_mps2, yaw_rate))
    return states


def _crossing(scenario: Scenario, world: World) -> list[ActorState]:
    """The actors that cross an intersection."""
    states = []
    for actor, way in zip(scenario.crossing_actors, scenario.routes, strict=True):
        s_m = way.arrival_m + actor.travelled_m(world.t_s) - actor.travelled_m(actor.arrive_s)
        speed, accel = actor.speed_and_accel(world.t_s)
        states.append(_state(world, actor, way.line.to_world(s_m, 0.0)[0], speed, accel, way.bend(s_m) * speed))
    return states


def _free(scenario: Scenario, world: World) -> list[ActorState]:
    """The actors on ways of their own."""
    states = []
    for actor, way in zip(scenario.free_actors, scenario.free_ways, strict=True):
        s_m = actor.travelled_m(world.t_s)
        speed, accel = actor.speed_and_accel(world.t_s)
        bend = actor.curvature_per_m(s_m)
        states.append(_state(world, actor, way.to_world(s_m, 0.0)[0], speed, accel, bend * speed))
    return states


def _state(
    world: World, actor: RoadUser, pose: F64, speed_mps: float, accel_mps2: float, yaw_rate: float
) -> ActorState:
    """An actor with a pose in the world, relative to the ego vehicle."""
    x, y = world.to_ego(pose[None])[0].tolist()
    return _placed(world, actor, x, y, float(pose[2]), speed_mps, accel_mps2, yaw_rate)


def _placed(
    world: World,
    actor: RoadUser,
    x: float,
    y: float,
    heading: float,
    speed_mps: float,
    accel_mps2: float,
    yaw_rate: float,
) -> ActorState:
    """An actor at ego x, y with direction ``heading`` in the world."""
    length, width, height = actor.size()
    yaw = remainder(heading - world.pose[2], 2 * pi)
    cuboid = Cuboid((x, y, height / 2 - LIDAR_HEIGHT_M + world.lift_m(x)), (length, width, height), yaw)
    return ActorState(actor, cuboid, speed_mps, accel_mps2 < _BRAKING_MPS2, yaw_rate)


def _yaw_rate(now: Motion, road: Road, s_m: float, way: float) -> float:
    """Yaw rate of an actor on the road at s; way: +1 along it, −1 against it."""
    bend = road.curvature_per_m(s_m)
    return way * (
        now.speed_mps * bend / (1.0 - bend * now.d_m) + now.d_accel_mps2 / max(now.speed_mps, _SLOWEST_STEER_MPS)
    )


def _drift_rad(now: Motion) -> float:
    """Angle of a vehicle that changes lanes to the left of the road's direction."""
    return atan2(now.d_rate_mps, max(now.speed_mps, _SLOWEST_STEER_MPS))
