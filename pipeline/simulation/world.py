"""The world at one moment, seen from the ego vehicle: who is where, and how the ego vehicle moves.

Ego frame: x forward, y left, z up, origin at the LiDAR, which sits level in the middle of the front bumper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, hypot, pi, remainder

import numpy as np

from pipeline.geometry import Cuboid
from pipeline.simulation.actors import Actor, Motion, motion
from pipeline.simulation.scenario import Scenario
from pipeline.types import F64

LIDAR_HEIGHT_M = 0.5
_BRAKING_MPS2 = -0.4


@dataclass(frozen=True)
class ActorState:
    """An actor at one moment, in the ego frame; braking: its brake lights are on."""

    actor: Actor
    cuboid: Cuboid
    speed_mps: float
    braking: bool


@dataclass(frozen=True)
class World:
    """The ego pose (world x, y, heading), its place (s, d) on the road, its motion and the actors, farthest first."""

    t_s: float
    pose: tuple[float, float, float]
    s_m: float
    d_m: float
    speed_mps: float
    yaw_rate_radps: float
    actors: tuple[ActorState, ...]

    def to_ego(self, world: F64) -> F64:
        """(N, 2) world points as ego x, y."""
        x, y, heading = self.pose
        c, s = np.cos(heading), np.sin(heading)
        away = world[:, :2] - (x, y)
        return np.column_stack([away[:, 0] * c + away[:, 1] * s, away[:, 1] * c - away[:, 0] * s])


def at(scenario: Scenario, t_s: float, ego: Motion | None = None) -> World:
    """The world at time t; nothing is carried from one moment to the next. ``ego`` given: the ego vehicle moves as
    that says (closed loop), else as its script says. The others follow their scripts either way."""
    road = scenario.road
    own = ego if ego is not None else motion(scenario.ego, road, t_s)
    s_m = scenario.ego.start_m + own.travelled_m
    x, y, road_heading = road.to_world(s_m, own.d_m)[0]
    heading = road_heading + _drift_rad(own)
    curvature = road.curvature_per_m(s_m)
    yaw_rate = own.speed_mps * curvature / (1.0 - curvature * own.d_m) + own.d_accel_mps2 / max(own.speed_mps, 0.1)
    world = World(t_s, (float(x), float(y), float(heading)), s_m, own.d_m, own.speed_mps, float(yaw_rate), ())
    return replace(world, actors=_actor_states(scenario, world))


def _actor_states(scenario: Scenario, world: World) -> tuple[ActorState, ...]:
    actors = scenario.actors
    motions = [motion(actor, scenario.road, world.t_s) for actor in actors]
    s_m = [_place_m(scenario, actor, now) for actor, now in zip(actors, motions, strict=True)]
    poses = scenario.road.to_world(np.array(s_m), np.array([now.d_m for now in motions]))
    places = world.to_ego(poses)
    states = []
    for actor, now, (x, y), heading in zip(actors, motions, places.tolist(), poses[:, 2].tolist(), strict=True):
        length, width, height = actor.size()
        yaw = heading - world.pose[2] + _direction(actor) * _drift_rad(now) + (pi if actor.lane > 0 else 0.0)
        cuboid = Cuboid((x, y, height / 2 - LIDAR_HEIGHT_M), (length, width, height), remainder(yaw, 2 * pi))
        states.append(ActorState(actor, cuboid, now.speed_mps, now.accel_mps2 < _BRAKING_MPS2))
    return tuple(sorted(states, key=lambda state: (-hypot(*state.cuboid.center[:2]), state.actor.id)))


def _place_m(scenario: Scenario, actor: Actor, now: Motion) -> float:
    """s of an actor's middle: ``ahead_m`` is to the face that is nearest at time 0."""
    half = actor.size()[0] / 2 if actor.ahead_m >= 0.0 else -actor.size()[0] / 2
    return scenario.ego.start_m + actor.ahead_m + half + _direction(actor) * now.travelled_m


def _direction(actor: Actor) -> float:
    """+1 along the road, −1 against it. Against it, a drift to the road's left is one to the driver's right."""
    return -1.0 if actor.lane > 0 else 1.0


def _drift_rad(now: Motion) -> float:
    """How far a vehicle that changes lanes points to the left of the road."""
    return atan2(now.d_rate_mps, max(now.speed_mps, 0.1))
