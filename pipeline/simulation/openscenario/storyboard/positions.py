"""Positions of OpenSCENARIO as places on the simulated road."""

from __future__ import annotations

from math import atan2, cos, degrees, pi, remainder, sin, tau
from typing import NamedTuple, Protocol

import numpy as np

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad, OffTheWay
from pipeline.simulation.openscenario.roads.network import FileRoad, Network
from pipeline.simulation.openscenario.xml_files import XmlElement, shown
from pipeline.simulation.world.lines import WorldPose

ON_ROADS = ("LanePosition", "RoadPosition", "WorldPosition")
"""Positions that refer to no entity."""
OFF_ROADS = ("TrajectoryPosition", "RoutePosition")
"""Positions that are read as poses in the file's world."""
_ALONG_RAD = 0.09
"""Maximum rotation from the road's direction, 5°: vehicles in the simulator point along the road."""
_LANE_M, _WAY_M = 3.0, 15.0
"""A place farther from the middle of every lane is not on the road; one farther from the way is elsewhere."""
_SUPPORTED = (
    "LanePosition, RoadPosition, WorldPosition, RelativeLanePosition, RelativeRoadPosition, RelativeObjectPosition, "
    "RelativeWorldPosition, TrajectoryPosition and RoutePosition are"
)


class RoadPlace(NamedTuple):
    """A place of an entity's reference point."""

    s_m: float
    """Along the reference line."""
    d_m: float
    """To the left of it."""
    way: int
    """+1 facing along the road, −1 against it."""


class Entities(Protocol):
    """The entities to which positions may refer. The elements are for messages."""

    def place_of(self, name: str, at: XmlElement, road: DrivenRoad) -> RoadPlace:
        """The place of an entity on a road, the nearest if it is not on it."""
        ...

    def follows(self, name: str, at: XmlElement, road: DrivenRoad) -> bool:
        """Whether an entity follows the lanes of a road."""
        ...

    def pose_at(self, position: XmlElement, scope: ParameterScope) -> WorldPose:
        """x, y and heading of a ``Position`` element in the file's world."""
        ...


class Turned(OffTheWay):
    """A place at which a vehicle would not face along the road."""


class BesideRoad(OffTheWay):
    """A place beside the road."""


def place_at(
    position: XmlElement, scope: ParameterScope, road: DrivenRoad, entities: Entities, on_road: bool = True
) -> RoadPlace:
    """The place that a ``Position`` element describes. OffTheWay if it is on another road than the ego vehicle's way,
    OpenScenarioError if it is on none. on_road: False if it may lie beside the road."""
    at = position.only()
    is_turned = at.tag == "RelativeObjectPosition" and not entities.follows(scope.text(at, "entityRef"), at, road)
    if is_turned or at.tag in OFF_ROADS:
        found = _from_pose(position, scope, road, entities)
    else:
        found = _from_road(at, scope, road, entities)
    if not 0.0 <= found.s_m <= road.length_m:
        raise at.refusal(
            f"{at.tag} lies at s = {found.s_m:.1f} m, outside road {shown(road.last_road)} ({road.length_m:g} m)"
        )
    edges = [edge for pair in road.road.edges_m() for edge in pair]
    beside = max(found.d_m - max(edges), min(edges) - found.d_m) - road.road.shoulder_m
    if on_road and beside > 0.0 and min(abs(found.d_m - d) for d in road.lanes_at(found.s_m).values()) > _LANE_M:
        there = shown(road.track_at(found.s_m).road.id)
        raise BesideRoad(
            f"{at.file}, line {at.line}: {at.tag} lies {abs(found.d_m):.1f} m beside the middle of road {there}, not "
            "on it"
        )
    return found


def _from_road(at: XmlElement, scope: ParameterScope, road: DrivenRoad, entities: Entities) -> RoadPlace:
    reader = {
        "LanePosition": _on_lane,
        "RoadPosition": _on_road,
        "WorldPosition": _in_world,
        "RelativeLanePosition": _beside_lanes,
        "RelativeRoadPosition": _along_road,
        "RelativeObjectPosition": _from_object,
        "RelativeWorldPosition": _from_object,
    }.get(at.tag)
    if reader is None:
        raise at.refusal(f"{shown(at.tag)} is not supported; {_SUPPORTED}")
    return reader(at, scope, road, entities)


def _from_pose(position: XmlElement, scope: ParameterScope, road: DrivenRoad, entities: Entities) -> RoadPlace:
    """A place on a trajectory or route, or relative to an entity that is elsewhere, seen from the road."""
    x, y, heading = entities.pose_at(position, scope)
    s, d = road.project(x, y)
    at = position.only()
    if abs(d) > _WAY_M or not 0.0 <= s <= road.length_m:
        raise OffTheWay(f"{at.file}, line {at.line}: {at.tag} lies off the way of the ego vehicle")
    return RoadPlace(s, d, way_of(heading - road.heading(s), at))


def lane_at(road: DrivenRoad, place: RoadPlace) -> int:
    """The driving lane of the file whose middle is nearest."""
    lanes = road.lanes_at(place.s_m)
    return min(lanes, key=lambda lane: abs(lanes[lane] - place.d_m))


def lane_beside(road: DrivenRoad, place: RoadPlace, count: int, at: XmlElement) -> int:
    """The driving lane ``count`` lanes to the left of the one at a place, as the file's road runs; lane 0, which has no
    width, is not counted."""
    ascending, lane = sorted(road.lanes_at(place.s_m)), lane_at(road, place)
    index = ascending.index(lane) + count
    if not 0 <= index < len(ascending):
        raise at.refusal(f"no driving lane {abs(count)} to the {'left' if count > 0 else 'right'} of lane {lane}")
    return ascending[index]


def file_road(at: XmlElement, scope: ParameterScope, network: Network) -> FileRoad:
    """The road that a position names, or else the file's only one."""
    if "roadId" in at.attributes:
        return network.road(scope.text(at, "roadId"), at)
    if len(network.roads) != 1:
        raise at.refusal(f"{len(network.roads)} roads; a position without roadId needs exactly one")
    return next(iter(network.roads.values()))


def file_place(at: XmlElement, scope: ParameterScope, network: Network) -> tuple[FileRoad, float, float, int]:
    """The road, s, t and lane of a LanePosition, RoadPosition or WorldPosition. The lane of a place that is on none is
    the nearest. OpenScenarioError if there is no such road or lane."""
    if at.tag == "WorldPosition":
        road, s, t = network.project(scope.number(at, "x"), scope.number(at, "y"))
        return road, s, t, _nearest_lane(road, s, t, at)
    road, s = file_road(at, scope, network), scope.number(at, "s")
    if not 0.0 <= s <= road.line.length_m:
        raise at.refusal(f"{at.tag} lies at s = {s:.1f} m, outside road {shown(road.id)} ({road.line.length_m:g} m)")
    if at.tag == "RoadPosition":
        t = scope.number(at, "t")
        return road, s, t, _nearest_lane(road, s, t, at)
    lane = scope.integer(at, "laneId")
    if lane not in road.lanes.section_at(s).lanes:
        known = ", ".join(map(str, road.lanes.driven_at(s)))
        raise at.refusal(f"road {shown(road.id)} has no lane {lane} at s = {s:.4g} m; vehicles drive on {known}")
    return road, s, sum(road.lanes.edges_at(lane, s)) / 2 + scope.number(at, "offset", 0.0), lane


def file_point(at: XmlElement, scope: ParameterScope, network: Network) -> tuple[float, float]:
    """x and y of a LanePosition, RoadPosition or WorldPosition in the file's world."""
    if at.tag == "WorldPosition":
        return scope.number(at, "x"), scope.number(at, "y")
    road, s, t, _ = file_place(at, scope, network)
    x, y = road.line.offset(np.array([s]), np.array([t]))[0].tolist()
    return x, y


def _nearest_lane(road: FileRoad, s_m: float, t_m: float, at: XmlElement) -> int:
    driven = road.lanes.driven_at(s_m)
    if not driven:
        raise at.refusal(f"road {shown(road.id)} has no driving lane at s = {s_m:.4g} m")
    return min(driven, key=lambda lane: abs(sum(road.lanes.edges_at(lane, s_m)) / 2 - t_m))


def _on_lane(at: XmlElement, scope: ParameterScope, road: DrivenRoad, entities: Entities) -> RoadPlace:
    there, s_file, t, lane = file_place(at, scope, road.network)
    s, d, way = road.place(there, s_file, t, at)
    return RoadPlace(s, d, _way(at, scope, road.heading(s), way * there.traffic_way(lane), None))


_on_road = _on_lane


def _in_world(at: XmlElement, scope: ParameterScope, road: DrivenRoad, entities: Entities) -> RoadPlace:
    x, y = scope.number(at, "x"), scope.number(at, "y")
    s, d = road.project(x, y)
    if len(road.network.roads) > 1:
        there, s_file, t = road.network.project(x, y)
        s, d, _ = road.place(there, s_file, t, at)
    return RoadPlace(s, d, way_of(scope.number(at, "h", 0.0) - road.heading(s), at))


def _beside_lanes(at: XmlElement, scope: ParameterScope, road: DrivenRoad, entities: Entities) -> RoadPlace:
    """Distances count along the file's road."""
    other = entities.place_of(scope.text(at, "entityRef"), at, road)
    lane = lane_beside(road, other, scope.integer(at, "dLane"), at)
    along = scope.number(at, "dsLane") if "dsLane" in at.attributes else scope.number(at, "ds")
    s = other.s_m + road.track_at(other.s_m).way * along
    middle = road.lane_or_refusal(s, lane, at)
    d = middle + road.left_of_file(s) * scope.number(at, "offset", 0.0)
    return RoadPlace(s, d, _way(at, scope, road.heading(s), road.traffic_way(s, lane), other))


def _along_road(at: XmlElement, scope: ParameterScope, road: DrivenRoad, entities: Entities) -> RoadPlace:
    other = entities.place_of(scope.text(at, "entityRef"), at, road)
    s = other.s_m + road.track_at(other.s_m).way * scope.number(at, "ds")
    here = RoadPlace(s, other.d_m + road.left_of_file(s) * scope.number(at, "dt"), other.way)
    usual = road.traffic_way(s, lane_at(road, here))
    return here._replace(way=_way(at, scope, road.heading(s), usual, other))


def _from_object(at: XmlElement, scope: ParameterScope, road: DrivenRoad, entities: Entities) -> RoadPlace:
    """dx and dy along the axes of the entity, or of the world."""
    other = entities.place_of(scope.text(at, "entityRef"), at, road)
    is_turned = at.tag == "RelativeObjectPosition"
    turned = road.heading(other.s_m) + (pi if other.way < 0 else 0.0) if is_turned else 0.0
    x, y = road.to_file_world(other.s_m, other.d_m)
    dx, dy = scope.number(at, "dx"), scope.number(at, "dy")
    if dx == dy == 0.0:
        return other._replace(way=_way(at, scope, road.heading(other.s_m), other.way, other))
    near_m = other.s_m + dx * other.way if is_turned else None
    s, d = road.project(x + dx * cos(turned) - dy * sin(turned), y + dx * sin(turned) + dy * cos(turned), near_m)
    return RoadPlace(s, d, _way(at, scope, road.heading(s), other.way, other))


def _way(at: XmlElement, scope: ParameterScope, road_heading: float, usual: int, other: RoadPlace | None) -> int:
    """The direction that an ``Orientation`` asks for; without one, the usual. It is relative to the other entity, or
    else to the lane, or absolute (the default)."""
    orientation = at.find("Orientation")
    if orientation is None or "h" not in orientation.attributes:
        return usual
    turned = scope.number(orientation, "h")
    if scope.text(orientation, "type", "absolute") == "relative":
        return way_of(turned, orientation) * (other.way if other is not None else usual)
    return way_of(turned - road_heading, orientation)


def way_of(turned_rad: float, at: XmlElement) -> int:
    """+1 along the road, −1 against it."""
    across = abs(atan2(sin(turned_rad), cos(turned_rad)))
    if across <= _ALONG_RAD:
        return 1
    if abs(remainder(across - pi, tau)) <= _ALONG_RAD:
        return -1
    raise Turned(
        f"{at.file}, line {at.line}: a vehicle turned by {degrees(across):.0f}° from the road is not supported; they "
        "face along the road"
    )
