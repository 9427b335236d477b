"""Random moments of random traffic on random roads, from one seed."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from pipeline.simulation.scenario import Scenario, load
from pipeline.simulation.sensors.camera import DrawnCamera
from pipeline.simulation.world import world_state
from pipeline.simulation.world.actors import SIZES_M, ActorKind
from pipeline.simulation.world.roads import Road
from pipeline.simulation.world.roadside import Roadside
from pipeline.types import U8

MOMENTS_A_ROAD = 20
_ROAD_M = 3000.0
_KINDS: tuple[ActorKind, ...] = ("car", "van", "truck", "bus", "motorcycle")
_SHARES = (0.52, 0.14, 0.16, 0.08, 0.10)
_MODELS_A_KIND = 12
_NEAREST_M, _FARTHEST_M = -9.0, 130.0
_CLEAR_AHEAD_M = 3.0
_LONGEST_CHANGE_S = 5.0
_BEYOND_M = 600.0
_SOME_TURNED, _TURNED, _SHORT_M = 0.35, 0.4, 7.0

BodySize = tuple[float, float, float]
BodyModels = dict[str, list[BodySize]]
"""Lengths, widths and heights of vehicles, by kind."""


@dataclass(frozen=True)
class DrawnScene:
    """A drawn image and its truth."""

    image: U8
    """(720, 1280, 3) uint8 blue green red."""
    world: world_state.World
    """The world that it shows."""


def moments(
    seed: int, count: int, wanted: Callable[[world_state.World], bool] = lambda _: True
) -> Iterator[DrawnScene]:
    """Yield those of ``count`` images whose world is ``wanted``; the others are not rendered. The same seed gives the
    same images; different seeds share no road, traffic or backdrop."""
    rng = np.random.default_rng([seed, 11])
    models = size_models(rng)
    for number in range(count):
        if number % MOMENTS_A_ROAD == 0:
            road = random_road(rng)
            backdrop = int(rng.integers(1 << 31))
            camera = DrawnCamera(road, Roadside.build(road, backdrop, 0.0, _ROAD_M), backdrop)
        now = world_state.at(random_traffic(rng, road, models), float(rng.uniform(0.0, _LONGEST_CHANGE_S)))
        if rng.random() < _SOME_TURNED:
            now = _turned(rng, now)
        now = without_collisions(now)
        if wanted(now):
            yield DrawnScene(camera.image(now), now)


def without_collisions(now: world_state.World) -> world_state.World:
    """The same world without actors that random braking and turning moved into the ego vehicle: no camera sees from
    inside a truck."""
    length, width, _ = SIZES_M["car"]
    own = np.array([[-length, -width / 2], [0.0, -width / 2], [0.0, width / 2], [-length, width / 2]], np.float32)
    clear = (cv2.intersectConvexConvex(own, s.cuboid.footprint().astype(np.float32))[0] <= 0.0 for s in now.actors)
    return replace(now, actors=tuple(itertools.compress(now.actors, clear)))


def _turned(rng: np.random.Generator, now: world_state.World) -> world_state.World:
    """The same world with some cars at random headings, as at crossings and turns."""
    actors = tuple(
        replace(state, cuboid=state.cuboid._replace(yaw_rad=float(rng.uniform(-np.pi, np.pi))))
        if state.cuboid.size[0] < _SHORT_M and rng.random() < _TURNED
        else state
        for state in now.actors
    )
    return replace(now, actors=actors)


def random_road(rng: np.random.Generator) -> Road:
    """One to four lanes each way; straight, or bends of 250 m radius and more."""
    bends = rng.random() < 0.6
    return Road.model_validate(
        {
            "segments": [
                {
                    "length_m": float(rng.uniform(60.0, 250.0)),
                    "curvature_per_m": float(rng.uniform(-1 / 250, 1 / 250)) if bends else 0.0,
                }
                for _ in range(12)
            ],
            "crossings": [{"s_m": float(s_m)} for s_m in _crossing_places(rng)],
            "lane_width_m": float(rng.uniform(3.0, 4.0)),
            "lanes_forward": int(rng.integers(1, 5)),
            "lanes_oncoming": int(rng.integers(0, 4)),
            "median_m": float(rng.choice([0.0, 0.5, 4.0, 8.0])),
            "shoulder_m": float(rng.uniform(0.5, 3.0)),
        }
    )


def _crossing_places(rng: np.random.Generator) -> list[float]:
    """Positions of crossings along the road: none on most roads, else about one every 150 m."""
    return [] if rng.random() < 0.6 else (np.arange(100.0, 2000.0, 150.0) + rng.uniform(0.0, 50.0)).tolist()


def random_traffic(rng: np.random.Generator, road: Road, models: BodyModels) -> Scenario:
    """Vehicles in every lane at about the ego vehicle's speed, some of them braking or changing lanes."""
    speed = float(rng.uniform(8.0, 30.0))
    ego_lane = -int(rng.integers(1, road.lanes_forward + 1))
    actors: list[dict[str, Any]] = []
    for lane in (*range(-road.lanes_forward, 0), *range(1, road.lanes_oncoming + 1)):
        ahead = rng.uniform(_CLEAR_AHEAD_M, 60.0) if lane == ego_lane else rng.uniform(_NEAREST_M, 40.0)
        mean_gap = rng.choice([12.0, 30.0, 60.0])
        while ahead < _FARTHEST_M:
            actor = _vehicle(rng, models, len(actors) + 1, lane, float(ahead), speed if lane < 0 else 0.0)
            actor["lane_changes"] = _lane_change(rng, road, lane)
            actors.append(actor)
            ahead += actor["size_m"][0] + 3.0 + rng.exponential(mean_gap)
    return Scenario.model_validate(
        {
            "title": "random traffic",
            "duration_s": _LONGEST_CHANGE_S,
            "road": road,
            "ego": {
                "lane": ego_lane,
                "speed_mps": {0.0: speed},
                "start_m": float(rng.uniform(50.0, 1500.0)),
                "lane_changes": _lane_change(rng, road, ego_lane),
            },
            "actors": actors,
        }
    )


def size_models(rng: np.random.Generator) -> BodyModels:
    """A dozen sizes of each kind of vehicle: few enough for the cache of meshes to be useful."""
    return {kind: [_grown(rng, SIZES_M[kind]) for _ in range(_MODELS_A_KIND)] for kind in _KINDS}


def _grown(rng: np.random.Generator, size_m: BodySize) -> BodySize:
    length, width, height = (
        float(side * factor) for side, factor in zip(size_m, rng.uniform(0.88, 1.14, 3), strict=True)
    )
    return length, width, height


def _vehicle(
    rng: np.random.Generator, models: BodyModels, number: int, lane: int, ahead_m: float, speed_mps: float
) -> dict[str, Any]:
    kind = str(rng.choice(_KINDS, p=_SHARES))
    braking = speed_mps > 0.0 and rng.random() < 0.3
    return {
        "id": number,
        "kind": kind,
        "lane": lane,
        "ahead_m": ahead_m,
        "size_m": models[kind][int(rng.integers(_MODELS_A_KIND))],
        "colour": _colour(rng),
        "speed_mps": {0.0: speed_mps, _LONGEST_CHANGE_S: speed_mps - 3.0} if braking else {0.0: speed_mps},
    }


def _colour(rng: np.random.Generator) -> str:
    """A random paint: a shade of grey for half of all vehicles, any colour for the rest."""
    rgb = np.full(3, rng.uniform(15, 245)) + rng.normal(0, 5, 3) if rng.random() < 0.5 else rng.uniform(10, 245, 3)
    return "#" + "".join(f"{int(np.clip(value, 0, 255)):02x}" for value in rgb)


def _lane_change(rng: np.random.Generator, road: Road, lane: int) -> list[dict[str, Any]]:
    """Sometimes a change to a neighbouring lane of the same carriageway."""
    lanes = road.lanes_forward if lane < 0 else road.lanes_oncoming
    beside = [n for n in (lane - 1, lane + 1) if 1 <= abs(n) <= lanes and n * lane > 0]
    if not beside or rng.random() > 0.2:
        return []
    return [{"start_s": 0.0, "duration_s": float(rng.uniform(3.0, _LONGEST_CHANGE_S)), "lane": int(rng.choice(beside))}]


def drive(name: str, step_s: float) -> Iterator[DrawnScene]:
    """Render a built-in scenario or a scenario file every ``step_s``."""
    scenario = load(name)
    end_m = world_state.at(scenario, scenario.duration_s).s_m + _BEYOND_M
    camera = DrawnCamera(scenario.road, Roadside.build(scenario.road, scenario.seed, 0.0, end_m), scenario.seed)
    for t_s in np.arange(0.0, scenario.duration_s, step_s).tolist():
        now = world_state.at(scenario, t_s)
        yield DrawnScene(camera.image(now), now)
