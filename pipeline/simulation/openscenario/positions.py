"""Positions of OpenSCENARIO as places on the simulated road."""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, degrees, pi, remainder, sin, tau
from typing import NamedTuple

from pipeline.simulation.openscenario.opendrive import DrivenRoad
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.xml_files import XmlElement, shown

_ALONG_RAD = 0.09
"""Maximum rotation from the road's direction, 5°: vehicles in the simulator point along the road."""
_SUPPORTED = (
    "LanePosition, RoadPosition, WorldPosition, RelativeLanePosition, RelativeRoadPosition, RelativeObjectPosition and "
    "RelativeWorldPosition are"
)


class RoadPlace(NamedTuple):
    """A place of an entity's reference point."""

    s_m: float
    """Along the reference line."""
    d_m: float
    """To the left of it."""
    way: int
    """+1 facing along the road, −1 against it."""


PlaceOf = Callable[[str, XmlElement], RoadPlace]
"""The place of an entity by name; the element is for messages."""


def place_at(position: XmlElement, scope: ParameterScope, road: DrivenRoad, place_of: PlaceOf) -> RoadPlace:
    """The place that a ``Position`` element describes. OpenScenarioError if it is not on the road."""
    at = position.only()
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
    found = reader(at, scope, road, place_of)
    if not 0.0 <= found.s_m <= road.length_m:
        raise at.refusal(f"{at.tag} lies at s = {found.s_m:.1f} m, outside road {shown(road.id)} ({road.length_m:g} m)")
    widest = max(abs(edge) for pair in road.road.edges_m() for edge in pair) + road.road.shoulder_m
    if abs(found.d_m) > widest:
        raise at.refusal(f"{at.tag} lies {abs(found.d_m):.1f} m beside the middle of road {shown(road.id)}, not on it")
    return found


def lane_way(d_m: float) -> int:
    """Direction of traffic at this offset: lanes to the left of the reference line run against it."""
    return 1 if d_m <= 0.0 else -1


def lane_at(road: DrivenRoad, d_m: float) -> int:
    """The driving lane of the file whose middle is nearest."""
    return min(road.lanes, key=lambda lane: abs(road.lanes[lane] - d_m))


def lane_beside(road: DrivenRoad, lane: int, count: int, at: XmlElement) -> int:
    """The driving lane ``count`` lanes to the left of another; lane 0, which has no width, is not counted."""
    ascending = sorted(road.lanes)
    index = ascending.index(lane) + count
    if not 0 <= index < len(ascending):
        raise at.refusal(f"no driving lane {abs(count)} to the {'left' if count > 0 else 'right'} of lane {lane}")
    return ascending[index]


def middle_of(road: DrivenRoad, lane: int, at: XmlElement) -> float:
    """d of the middle of a driving lane."""
    if lane not in road.lanes:
        known = ", ".join(map(str, sorted(road.lanes)))
        raise at.refusal(f"road {shown(road.id)} has no driving lane {lane}; there are {known}")
    return road.lanes[lane]


def _on_lane(at: XmlElement, scope: ParameterScope, road: DrivenRoad, place_of: PlaceOf) -> RoadPlace:
    lane, s = scope.integer(at, "laneId"), scope.number(at, "s")
    middle = middle_of(road, lane, at)
    return RoadPlace(
        s, middle + scope.number(at, "offset", 0.0), _way(at, scope, road.heading(s), lane_way(middle), None)
    )


def _on_road(at: XmlElement, scope: ParameterScope, road: DrivenRoad, place_of: PlaceOf) -> RoadPlace:
    s, d = scope.number(at, "s"), scope.number(at, "t")
    return RoadPlace(s, d, _way(at, scope, road.heading(s), lane_way(d), None))


def _in_world(at: XmlElement, scope: ParameterScope, road: DrivenRoad, place_of: PlaceOf) -> RoadPlace:
    s, d = road.project(scope.number(at, "x"), scope.number(at, "y"))
    return RoadPlace(s, d, _way_of(scope.number(at, "h", 0.0) - road.heading(s), at))


def _beside_lanes(at: XmlElement, scope: ParameterScope, road: DrivenRoad, place_of: PlaceOf) -> RoadPlace:
    other = place_of(scope.text(at, "entityRef"), at)
    lane = lane_beside(road, lane_at(road, other.d_m), scope.integer(at, "dLane"), at)
    along = scope.number(at, "dsLane") if "dsLane" in at.attributes else scope.number(at, "ds")
    s, middle = other.s_m + along, road.lanes[lane]
    d = middle + scope.number(at, "offset", 0.0)
    return RoadPlace(s, d, _way(at, scope, road.heading(s), lane_way(middle), other))


def _along_road(at: XmlElement, scope: ParameterScope, road: DrivenRoad, place_of: PlaceOf) -> RoadPlace:
    other = place_of(scope.text(at, "entityRef"), at)
    s, d = other.s_m + scope.number(at, "ds"), other.d_m + scope.number(at, "dt")
    return RoadPlace(s, d, _way(at, scope, road.heading(s), lane_way(d), other))


def _from_object(at: XmlElement, scope: ParameterScope, road: DrivenRoad, place_of: PlaceOf) -> RoadPlace:
    """dx and dy along the axes of the entity, or of the world."""
    other = place_of(scope.text(at, "entityRef"), at)
    turned = road.heading(other.s_m) + (pi if other.way < 0 else 0.0) if at.tag == "RelativeObjectPosition" else 0.0
    x, y = road.to_file_world(other.s_m, other.d_m)
    dx, dy = scope.number(at, "dx"), scope.number(at, "dy")
    s, d = road.project(x + dx * cos(turned) - dy * sin(turned), y + dx * sin(turned) + dy * cos(turned))
    return RoadPlace(s, d, _way(at, scope, road.heading(s), other.way, other))


def _way(at: XmlElement, scope: ParameterScope, road_heading: float, usual: int, other: RoadPlace | None) -> int:
    """The direction that an ``Orientation`` asks for; without one, the usual. It is relative to the other entity, or
    else to the lane, or absolute (the default)."""
    orientation = at.find("Orientation")
    if orientation is None or "h" not in orientation.attributes:
        return usual
    turned = scope.number(orientation, "h")
    if scope.text(orientation, "type", "absolute") == "relative":
        return _way_of(turned, orientation) * (other.way if other is not None else usual)
    return _way_of(turned - road_heading, orientation)


def _way_of(turned_rad: float, at: XmlElement) -> int:
    """+1 along the road, −1 against it."""
    across = abs(atan2(sin(turned_rad), cos(turned_rad)))
    if across <= _ALONG_RAD:
        return 1
    if abs(remainder(across - pi, tau)) <= _ALONG_RAD:
        return -1
    raise at.refusal(
        f"a vehicle turned by {degrees(across):.0f}° from the road is not supported; they face along the road"
    )
