"""Roads of a file that lead straight across the driven one, as crossings that the simulator draws."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import cos, degrees, pi, sin, tau

import numpy as np

from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.roads.network import FileRoad
from pipeline.simulation.world.roads import Crossing

_REACH_M, _STEP_M = 60.0, 0.5
"""How far an arm ends from the way at most, and the step at which the way is searched."""
_SAME_M, _SAME_DEG = 3.0, 10.0
"""Two arms that meet the way at the same place in opposite directions are one road across it."""
_STRAIGHT_M, _LOOKED_M = 2.0, 100.0
"""An arm that leaves its direction by more than this, as far as it is looked at, is not drawn straight."""


@dataclass(frozen=True)
class _Arm:
    """A road that ends at a junction on the way."""

    s_m: float
    """Where its line, continued, meets the way."""
    angle_deg: float
    """Its direction into the junction, to the left of the way's, −180 to 180."""
    lanes: int
    """The most driving lanes of a direction."""
    lane_width_m: float
    """Their mean width."""


def crossing_roads(road: DrivenRoad) -> tuple[Crossing, ...]:
    """The crossings of the simulator for roads that lead across the way on both sides."""
    junctions = {track.road.junction for track in road.tracks} - {None}
    arms = [
        arm
        for each in road.network.roads.values()
        if each.junction is None and each.id not in road.road_ids
        for way in (1, -1)
        if (end := each.end(way)) is not None and end.is_junction and end.id in junctions
        if (arm := _arm(each, way, road)) is not None
    ]
    found = [_crossing(one, other) for one, other in combinations(arms, 2) if _are_one(one, other)]
    return tuple(sorted((each for each in found if each is not None), key=lambda each: each.s_m))


def _arm(arm: FileRoad, way: int, road: DrivenRoad) -> _Arm | None:
    """The arm whose end (way +1) or beginning (−1) is at the junction; None if it does not lead straight to the way."""
    length_m = arm.line.length_m
    s = np.linspace(
        length_m if way > 0 else 0.0, max(length_m - _LOOKED_M, 0.0) if way > 0 else min(length_m, _LOOKED_M), 21
    )
    line = arm.line.at(s)
    x, y, heading = line[0, :3].tolist()
    heading += 0.0 if way > 0 else pi
    c, d = cos(heading), sin(heading)
    if np.abs((line[:, 1] - y) * c - (line[:, 0] - x) * d).max() > _STRAIGHT_M:
        return None
    near_m = road.project(x, y)[0]
    at = np.arange(max(near_m - _REACH_M, 0.0), min(near_m + _REACH_M, road.length_m), _STEP_M)
    if len(at) < 2:
        return None
    away = np.array([road.to_file_world(s_m, 0.0) for s_m in at.tolist()]) - (x, y)
    across, along = away[:, 1] * c - away[:, 0] * d, away[:, 0] * c + away[:, 1] * d
    met = np.flatnonzero((across[:-1] * across[1:] <= 0.0) & (np.abs(along[:-1]) < _REACH_M))
    if not len(met):
        return None
    k = int(met[0])
    meets_m = (
        float(at[k] + _STEP_M * across[k] / (across[k] - across[k + 1])) if across[k] != across[k + 1] else float(at[k])
    )
    turned = road.hand * (heading - road.heading(meets_m))
    driven = arm.lanes.driven_at(float(s[0]))
    if not driven:
        return None
    edges = [arm.lanes.edges_at(lane, float(s[0])) for lane in driven]
    lanes = max(sum(lane > 0 for lane in driven), sum(lane < 0 for lane in driven))
    angle = degrees((turned + pi) % tau - pi)
    return _Arm(meets_m, angle, lanes, float(np.mean([abs(a - b) for a, b in edges])))


def _are_one(one: _Arm, other: _Arm) -> bool:
    opposite = abs(abs(one.angle_deg - other.angle_deg) - 180.0)
    return abs(one.s_m - other.s_m) < _SAME_M and opposite < _SAME_DEG


def _crossing(one: _Arm, other: _Arm) -> Crossing | None:
    """None for an angle or lanes that the simulator does not have."""
    from_right = one if one.angle_deg > 0.0 else other
    if not 40.0 <= from_right.angle_deg <= 140.0:
        return None
    return Crossing(
        s_m=(one.s_m + other.s_m) / 2,
        angle_deg=from_right.angle_deg,
        lanes_each_way=min(max(one.lanes, other.lanes), 3),
        lane_width_m=min(max((one.lane_width_m + other.lane_width_m) / 2, 2.5), 5.0),
    )
