"""Roads and lines of entities that start off the way of the ego vehicle."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from pipeline.simulation.openscenario.roads.building import driven_road
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.roads.network import FileRoad, Network
from pipeline.simulation.openscenario.storyboard.start import start_at
from pipeline.simulation.world.lines import WorldPose

_ALONG_SIN, _BESIDE_M = 0.09, 3.0
"""An entity turned from a road by more than 5°, or farther from the middle of every lane, does not drive along it."""
_LOOKED_M, _LOOK_STEP_M, _LEVEL_M = 2_000.0, 10.0, 2.0
"""How far ways are followed to see whether they cross at different heights, the step, and the least difference."""


def own_road(pose: WorldPose, wanted: frozenset[str], network: Network) -> DrivenRoad | None:
    """The road along which an entity drives from a pose; None if it faces along none, or is beside all lanes: then it
    moves straight on. wanted: roads to take at junctions."""
    x, y, heading = pose
    start, t_m = start_at(network, x, y)
    turned = heading - float(start.road.line.at(np.array([start.s_m]))[0, 2])
    away_m = abs(sum(start.road.lanes.edges_at(start.lane, start.s_m)) / 2 - t_m)
    if abs(sin(turned)) > _ALONG_SIN or away_m > _BESIDE_M:
        return None
    return driven_road(network, start.road, start.s_m, start.lane, 1 if cos(turned) > 0.0 else -1, wanted)


def is_on_other_level(own: DrivenRoad, pose: WorldPose, road: DrivenRoad) -> bool:
    """Whether a way crosses the ego vehicle's road on a bridge or in a tunnel."""
    start_m = own.project(pose[0], pose[1])[0]
    s_m = np.arange(start_m, min(own.length_m, start_m + _LOOKED_M), _LOOK_STEP_M)
    points = np.array([own.to_file_world(s, 0.0) for s in s_m.tolist()]).reshape(-1, 2)
    at_m, apart_m = road.nearest_m(points)
    return any(
        abs(own.height_m(s) - road.height_m(at)) > _LEVEL_M
        for s, at, apart in zip(s_m.tolist(), at_m.tolist(), apart_m.tolist(), strict=True)
        if apart < _LOOK_STEP_M
    )


def may_meet(start: FileRoad, road: DrivenRoad) -> list[str]:
    """The roads of the ego vehicle's way, and across it, onto which a vehicle on another road may come."""
    return sorted({each.id for each in _reached(start, road.network)} & _met(road))


def _met(road: DrivenRoad) -> set[str]:
    """The roads of the way, and those through the same junctions."""
    everything = road.network.roads.values()
    junctions = {road.network.roads[number].junction for number in road.road_ids} - {None}
    return {*road.road_ids, *(each.id for each in everything if each.junction in junctions)}


def _reached(road: FileRoad, network: Network) -> list[FileRoad]:
    """All roads that are joined to one, in any direction, itself included."""
    found, waiting = {road.id: road}, [road]
    while waiting:
        here = waiting.pop()
        ends = [end for end in (here.end(1), here.end(-1)) if end is not None]
        there = [each for end in ends if end.is_junction for each in network.through(end.id)]
        there += [network.roads[end.id] for end in ends if not end.is_junction and end.id in network.roads]
        for each in there:
            if each.id not in found:
                found[each.id] = each
                waiting.append(each)
    return list(found.values())
