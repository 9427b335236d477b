"""Positions of OpenSCENARIO as poses in the file's world, independent of the ego vehicle's way."""

from __future__ import annotations

from math import cos, pi, sin
from typing import Protocol

import numpy as np

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.roads.building import driven_road
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.roads.network import Network
from pipeline.simulation.openscenario.storyboard.positions import ON_ROADS, Entities, file_place, place_at
from pipeline.simulation.openscenario.storyboard.trajectories import read_trajectory
from pipeline.simulation.openscenario.xml_files import XmlElement, shown
from pipeline.simulation.world.lines import WorldPose


class PlacedEntities(Entities, Protocol):
    """The entities to which positions may refer, with the roads that they follow."""

    @property
    def network(self) -> Network:
        """All roads of the file."""
        ...

    def pose_of(self, name: str, at: XmlElement) -> WorldPose:
        """x, y and heading of an entity's reference point."""
        ...

    def road_of(self, name: str, at: XmlElement) -> DrivenRoad:
        """The road whose lanes an entity follows. OpenScenarioError if it follows none."""
        ...


def pose_at(position: XmlElement, scope: ParameterScope, entities: PlacedEntities) -> WorldPose:
    """The pose that a ``Position`` element describes; without an orientation, it faces along its lane, trajectory or
    route, or as the entity to which it refers. OpenScenarioError if it cannot be simulated."""
    at = position.only()
    if at.tag == "WorldPosition":
        return scope.number(at, "x"), scope.number(at, "y"), scope.number(at, "h", 0.0)
    if at.tag in ON_ROADS:
        road, s_m, t_m, lane = file_place(at, scope, entities.network)
        x, y = road.line.offset(np.array([s_m]), np.array([t_m]))[0].tolist()
        heading = float(road.line.at(np.array([s_m]))[0, 2]) + (0.0 if road.traffic_way(lane) > 0 else pi)
        return x, y, _faced(at, scope, heading)
    if at.tag == "TrajectoryPosition":
        return _on_trajectory(at, scope, entities)
    if at.tag == "RoutePosition":
        return _on_route(at, scope, entities)
    if at.tag in ("RelativeLanePosition", "RelativeRoadPosition"):
        followed = entities.road_of(scope.text(at, "entityRef"), at)
        place = place_at(position, scope, followed, entities, on_road=False)
        x, y = followed.to_file_world(place.s_m, place.d_m)
        return x, y, followed.heading(place.s_m) + (0.0 if place.way > 0 else pi)
    if at.tag in ("RelativeObjectPosition", "RelativeWorldPosition"):
        x, y, heading = entities.pose_of(scope.text(at, "entityRef"), at)
        turned = heading if at.tag == "RelativeObjectPosition" else 0.0
        dx, dy = scope.number(at, "dx"), scope.number(at, "dy")
        x, y = x + dx * cos(turned) - dy * sin(turned), y + dx * sin(turned) + dy * cos(turned)
        return x, y, _faced(at, scope, heading)
    raise at.refusal(f"{shown(at.tag)} is not supported")


def _faced(at: XmlElement, scope: ParameterScope, usual_rad: float) -> float:
    """The heading that an ``Orientation`` asks for: absolute, or relative to the usual one."""
    orientation = at.find("Orientation")
    if orientation is None or "h" not in orientation.attributes:
        return usual_rad
    turned = scope.number(orientation, "h")
    return usual_rad + turned if scope.text(orientation, "type", "absolute") == "relative" else turned


def _on_trajectory(at: XmlElement, scope: ParameterScope, entities: PlacedEntities) -> WorldPose:
    """At s along a trajectory, t to its left."""
    found = at.one("TrajectoryRef").find("Trajectory")
    if found is None:
        raise at.refusal("TrajectoryPosition needs a Trajectory")
    line = read_trajectory(found, scope, entities).line
    x, y, heading = line.pose(scope.number(at, "s"))
    t = scope.number(at, "t", 0.0)
    return x - t * sin(heading), y + t * cos(heading), _faced(at, scope, heading)


def _on_route(at: XmlElement, scope: ParameterScope, entities: PlacedEntities) -> WorldPose:
    """At a distance along a route; lanes and t count to the left of its direction."""
    route, where = at.one("RouteRef").find("Route"), at.one("InRoutePosition").only()
    if route is None:
        raise at.refusal("RoutePosition needs a Route")
    if "pathS" not in where.attributes:
        raise where.refusal(f"{shown(where.tag)} is not supported; FromLaneCoordinates and FromRoadCoordinates are")
    road, start_m = route_road(route, scope, entities.network)
    s_m = start_m + scope.number(where, "pathS")
    if not 0.0 <= s_m <= road.length_m:
        raise where.refusal(f"pathS={scope.number(where, 'pathS'):g} lies beyond the route, which ends after "
                            f"{road.length_m - start_m:.1f} m")  # fmt: skip
    if "laneId" in where.attributes:
        lane = scope.integer(where, "laneId") * road.track_at(s_m).way
        d_m = road.lane_or_refusal(s_m, lane, where) + road.hand * scope.number(where, "laneOffset", 0.0)
    else:
        d_m = road.hand * scope.number(where, "t", 0.0)
    x, y = road.to_file_world(s_m, d_m)
    return x, y, _faced(at, scope, road.heading(s_m))


def route_road(route: XmlElement, scope: ParameterScope, network: Network) -> tuple[DrivenRoad, float]:
    """The road of a ``Route``, and s of its first waypoint."""
    positions = [each.one("Position").only() for each in route.all("Waypoint")]
    if not positions or any(each.tag not in ON_ROADS for each in positions):
        raise route.refusal(f"a Route needs waypoints by {', '.join(ON_ROADS)}")
    places = [file_place(each, scope, network) for each in positions]
    road, s_m, _, lane = places[0]
    found = driven_road(network, road, s_m, lane, road.traffic_way(lane), frozenset(each[0].id for each in places))
    return found, found.project(*road.line.offset(np.array([s_m]), np.array([0.0]))[0].tolist())[0]
