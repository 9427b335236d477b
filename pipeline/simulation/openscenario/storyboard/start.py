"""Where the ego vehicle starts in the file, which decides along which roads the scenario is simulated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.roads.network import FileRoad, Network
from pipeline.simulation.openscenario.storyboard.positions import ON_ROADS, file_place
from pipeline.simulation.openscenario.xml_files import XmlElement, shown


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
    if not at.tag.startswith("Relative"):
        raise at.refusal(f"{shown(at.tag)} is not supported; {', '.join(ON_ROADS)} and positions relative to these are")
    other = scope.text(at, "entityRef")
    if other in (name, *asked):
        raise at.refusal(f"the position of {shown(other)} refers to itself")
    if other not in teleports:
        raise at.refusal(f"no entity {shown(other)!r} with a position")
    return file_start(other, teleports, scope, network, (*asked, name))


def with_scopes(storyboard: XmlElement, scope: ParameterScope) -> Iterator[tuple[XmlElement, ParameterScope]]:
    """The Init, the stories and the rest of a storyboard, with the parameters that are visible there."""
    for each in storyboard.children:
        inner = ParameterScope(scope.values)
        inner.declare(each, {})
        yield each, inner


def ego_roads(storyboard: XmlElement, ego: str, scope: ParameterScope) -> frozenset[str]:
    """The roads that a route of the ego vehicle, or a condition on its place, names: it takes them at junctions."""
    return frozenset(
        inner.text(named, "roadId")
        for part, inner in with_scopes(storyboard, scope)
        for each in part.below()
        if _concerns(each, ego, inner)
        for named in each.below()
        if "roadId" in named.attributes
    )


def _concerns(at: XmlElement, ego: str, scope: ParameterScope) -> bool:
    """Whether an element says where the ego vehicle is to be."""
    if at.tag == "Private":
        return scope.text(at, "entityRef", "") == ego
    if at.tag == "ByEntityCondition":
        who = at.find("TriggeringEntities")
    elif at.tag == "ManeuverGroup" and any(each.tag == "RoutingAction" for each in at.below()):
        who = at.find("Actors")
    else:
        return False
    return who is not None and any(scope.text(each, "entityRef", "") == ego for each in who.all("EntityRef"))
