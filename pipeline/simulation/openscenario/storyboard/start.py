"""Where the ego vehicle starts in the file, which decides along which roads the scenario is simulated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import cos

import numpy as np

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.roads.building import driven_road, road_along
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.roads.free_line import FreeLine
from pipeline.simulation.openscenario.roads.network import FileRoad, Network
from pipeline.simulation.openscenario.storyboard.poses import pose_at
from pipeline.simulation.openscenario.storyboard.positions import OFF_ROADS, ON_ROADS, RoadPlace, file_place
from pipeline.simulation.openscenario.storyboard.trajectories import Trajectory
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, XmlElement, shown
from pipeline.simulation.world.lines import WorldPose

_STEP_M, _PARALLEL_M = 2.0, 0.3
"""Step at which a trajectory is compared with the roads, and by how much it may leave its lane."""


@dataclass(frozen=True)
class FileStart:
    """A lane of the file on which a vehicle starts."""

    road: FileRoad
    """On which it starts."""
    s_m: float
    """Along it."""
    lane: int
    """The lane, which may be one on which no vehicles drive."""

    def driven_lane(self) -> int:
        """The nearest lane on which vehicles drive; the lane itself if there is none."""
        driven = self.road.lanes.driven_at(self.s_m)
        return min(driven, key=lambda each: ((each > 0) != (self.lane > 0), abs(each - self.lane)), default=self.lane)


def file_start(
    name: str,
    teleports: Mapping[str, XmlElement],
    scope: ParameterScope,
    network: Network,
    asked: tuple[str, ...] = (),
) -> FileStart:
    """Where an entity starts. A position relative to another entity stands for the place of that one. asked: who is
    waiting for it."""
    at = teleports[name].only()
    if at.tag in ON_ROADS:
        road, s, _, lane = file_place(at, scope, network)
        return FileStart(road, s, lane)
    if at.tag in OFF_ROADS:
        x, y, _ = pose_at(teleports[name], scope, NoEntities(network))
        return start_at(network, x, y)[0]
    if not at.tag.startswith("Relative"):
        raise at.refusal(f"{shown(at.tag)} is not supported; {', '.join(ON_ROADS)} and positions relative to these are")
    other = scope.text(at, "entityRef")
    if other in (name, *asked):
        raise at.refusal(f"the position of {shown(other)} refers to itself")
    if other not in teleports:
        raise at.refusal(f"no entity {shown(other)!r} with a position")
    return file_start(other, teleports, scope, network, (*asked, name))


def start_at(network: Network, x_m: float, y_m: float) -> tuple[FileStart, float]:
    """The nearest lane to a point of the file's world, and t there."""
    road, s, t = network.project(x_m, y_m)
    driven = road.lanes.driven_at(s) or list(road.lanes.section_at(s).lanes)
    lane = min(driven, key=lambda each: abs(sum(road.lanes.edges_at(each, s)) / 2 - t))
    return FileStart(road, min(max(s, 0.0), road.line.length_m), lane), t


@dataclass(frozen=True)
class NoEntities:
    """The file before any entity is placed: positions that refer to one are refused."""

    network: Network
    """All roads of the file."""

    def place_of(self, name: str, at: XmlElement, road: DrivenRoad) -> RoadPlace:
        raise self._refusal(name, at)

    def pose_of(self, name: str, at: XmlElement) -> WorldPose:
        raise self._refusal(name, at)

    def follows(self, name: str, at: XmlElement, road: DrivenRoad) -> bool:
        raise self._refusal(name, at)

    def road_of(self, name: str, at: XmlElement) -> DrivenRoad:
        raise self._refusal(name, at)

    def pose_at(self, position: XmlElement, scope: ParameterScope) -> WorldPose:
        return pose_at(position, scope, self)

    def _refusal(self, name: str, at: XmlElement) -> OpenScenarioError:
        return at.refusal(f"the start of the ego vehicle cannot refer to {shown(name)}, which is placed after it")


def ego_way(
    trajectory: Trajectory, start_m: float, network: Network, wanted: frozenset[str], name: str
) -> tuple[DrivenRoad, RoadPlace]:
    """The road along which the ego vehicle follows a trajectory from s = start_m, and its place there: the file's
    roads if it keeps to their lanes, else the trajectory itself."""
    line = trajectory.line.from_m(start_m)
    x, y, heading = line.start
    start, t_m = start_at(network, x, y)
    way = 1 if cos(heading - float(start.road.line.at(np.array([start.s_m]))[0, 2])) >= 0.0 else -1
    here = [each for each in start.road.lanes.driven_at(start.s_m) if start.road.traffic_way(each) == way]
    if not here:
        raise trajectory.at.refusal(
            f"road {shown(start.road.id)} has no driving lane in the direction in which {shown(name)} starts"
        )
    lane = min(here, key=lambda each: abs(sum(start.road.lanes.edges_at(each, start.s_m)) / 2 - t_m))
    road = driven_road(network, start.road, start.s_m, lane, way, wanted)
    if not _keeps_to(road, line):
        road = road_along(network, start.road, start.s_m, t_m, lane, way, line)
    s_m, d_m = road.project(x, y)
    return road, RoadPlace(s_m, d_m, 1)


def _keeps_to(road: DrivenRoad, line: FreeLine) -> bool:
    """Whether a line runs parallel to the reference line of a road, up to where that ends."""
    s = np.arange(0.0, line.length_m, _STEP_M)
    at_m, offsets = zip(*(road.project(x, y) for x, y, _ in line.line.to_world(s, 0.0).tolist()), strict=True)
    inside = np.array(at_m) <= road.length_m
    return bool(np.ptp(np.array(offsets)[inside]) <= _PARALLEL_M and inside[0])


def with_scopes(storyboard: XmlElement, scope: ParameterScope) -> Iterator[tuple[XmlElement, ParameterScope]]:
    """The Init, the stories and the rest of a storyboard, with the parameters that are visible there."""
    for each in storyboard.children:
        inner = ParameterScope(scope.values)
        inner.declare(each, {})
        yield each, inner


def named_roads(storyboard: XmlElement, name: str, scope: ParameterScope) -> frozenset[str]:
    """The roads that a route of an entity, or a condition on its place, names: it takes them at junctions."""
    return frozenset(
        inner.text(named, "roadId")
        for part, inner in with_scopes(storyboard, scope)
        for each in part.below()
        if _concerns(each, name, inner)
        for named in each.below()
        if "roadId" in named.attributes
    )


def _concerns(at: XmlElement, name: str, scope: ParameterScope) -> bool:
    """Whether an element says where an entity is to be."""
    if at.tag == "Private":
        return scope.text(at, "entityRef", "") == name
    if at.tag == "ByEntityCondition":
        who = at.find("TriggeringEntities")
    elif at.tag == "ManeuverGroup" and any(each.tag == "RoutingAction" for each in at.below()):
        who = at.find("Actors")
    else:
        return False
    return who is not None and any(scope.text(each, "entityRef", "") == name for each in who.all("EntityRef"))
