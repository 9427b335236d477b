"""Puts the entities of a scenario on the road, or leaves out what the simulator does not have and what the ego vehicle
does not meet."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pipeline.simulation.openscenario.entities import VehicleBody
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.roads.driven_road import OffTheWay
from pipeline.simulation.openscenario.roads.network import FileRoad, Network
from pipeline.simulation.openscenario.storyboard.movers import Mover
from pipeline.simulation.openscenario.storyboard.positions import PlaceOf, RoadPlace, place_at
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.storyboard.start import file_start, with_scopes
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, XmlElement, shown

_AHEAD_STEP_M = 5.0
_STANDING = ("TeleportAction", "AppearanceAction", "ControllerAction", "ActivateControllerAction", "VisibilityAction")


class Placing:
    """The entities of one scenario."""

    def __init__(
        self,
        storyboard: XmlElement,
        scope: ParameterScope,
        bodies: Mapping[str, VehicleBody],
    ) -> None:
        self._storyboard, self._scope, self._bodies = storyboard, scope, bodies
        self._acting = set(_actors(storyboard, scope))
        self.teleports: dict[str, XmlElement] = {}
        """Entity → its position in the Init."""
        self.others: list[tuple[XmlElement, list[str]]] = []
        """The other actions of the Init, and their entities."""

    def check_kinds(self, ego: str) -> None:
        """OpenScenarioError for entities that the simulator does not have if they are all there is besides the ego
        vehicle, or if the storyboard moves them."""
        others = [body for name, body in self._bodies.items() if name != ego]
        strangers = [body for body in others if body.kind is None]
        if strangers and len(strangers) == len(others):
            raise strangers[0].refusal()
        for body in strangers:
            if body.name in self._acting or self._is_routed(body.name):
                raise body.refusal(" when it acts in the storyboard")

    def read_init(self) -> None:
        """Read the Init. OpenScenarioError for an action of an entity that does not exist."""
        actions = self._storyboard.one("Init").find("Actions")
        if actions is None:
            return
        self.others += [(each, []) for each in actions.all("GlobalAction")]
        for private in actions.all("Private"):
            name = self._scope.text(private, "entityRef")
            if name not in self._bodies:
                raise private.refusal(f"no entity {shown(name)!r}")
            for action in private.all("PrivateAction"):
                teleport = action.find("TeleportAction")
                if teleport is not None:
                    self.teleports[name] = teleport.one("Position")
                else:
                    self.others.append((action, [name]))

    def put_ego(self, stage: PlayedScenario) -> None:
        """Place the ego vehicle, and before it those to which its position refers."""
        self._put(stage.ego, stage, ())

    def put_all(self, stage: PlayedScenario) -> None:
        """Place every entity, each after those to which its position refers."""
        for name in self._bodies:
            self._put(name, stage, ())

    def _put(self, name: str, stage: PlayedScenario, asked: tuple[str, ...]) -> None:
        """asked: who is waiting for it."""
        if name in stage.movers or name in stage.left_out:
            return
        body = self._bodies[name]
        if name not in self.teleports:
            self._leave_out(stage, f"{shown(name)} is left out: it has no position at the start.", name)
            return

        def place_of(other: str, at: XmlElement) -> RoadPlace:
            if other in (name, *asked):
                raise at.refusal(f"the position of {shown(other)} refers to itself")
            if other in self._bodies:
                self._put(other, stage, (*asked, name))
            return stage.place_of(other, at)

        position = self.teleports[name]
        if body.kind is None:
            self._check_stranger(body, _without_orientation(position), stage, place_of)
            return
        try:
            place = place_at(position, self._scope, stage.road, place_of)
        except OffTheWay as error:
            if name == stage.ego:
                raise
            self._check_elsewhere(name, stage, error)
            return
        stage.movers[name] = Mover(body, place, stage.road, position)

    def _check_stranger(
        self, body: VehicleBody, position: XmlElement, stage: PlayedScenario, place_of: PlaceOf
    ) -> None:
        """Leave out what stands or moves beside the driving lanes."""
        try:
            place = place_at(position, self._scope, stage.road, place_of)
        except OffTheWay:
            place = None
        except OpenScenarioError as error:
            if "beside the middle of road" not in str(error):
                raise
            place = None
        reach = [] if place is None else [place.s_m]
        while reach and self._moves(body.name) and reach[-1] + _AHEAD_STEP_M < stage.road.length_m:
            reach.append(reach[-1] + _AHEAD_STEP_M)
        for s_m in reach:
            track = stage.road.track_at(s_m)
            for a, b in track.lane_edges(s_m, stage.road.hand).values():
                if place is not None and min(a, b) - body.size_m[1] / 2 < place.d_m < max(a, b) + body.size_m[1] / 2:
                    raise body.refusal(" on a driving lane")
        self._leave_out(
            stage, f"{shown(body.name)}, a {shown(body.what)} beside the driving lanes, is left out.", body.name
        )

    def _check_elsewhere(self, name: str, stage: PlayedScenario, error: OffTheWay) -> None:
        """Leave out a vehicle that never comes onto the way of the ego vehicle."""
        start = file_start(name, self.teleports, self._scope, stage.road.network)
        if self._moves(name):
            met = {road.id for road in _reached(start.road, stage.road.network)} & _met(stage)
            if met:
                raise OpenScenarioError(
                    f"{error}, and {shown(name)} may come onto road {shown(sorted(met)[0])}, which is on or across it"
                )
        what = "drives elsewhere" if self._moves(name) else "stands elsewhere"
        self._leave_out(stage, f"{shown(name)} is left out: it {what}, on road {shown(start.road.id)}.", name)

    def _leave_out(self, stage: PlayedScenario, note: str, name: str) -> None:
        stage.left_out.add(name)
        stage.note(note)

    def _moves(self, name: str) -> bool:
        """Whether an entity ever moves."""
        if name in self._acting or self._is_routed(name):
            return True
        for action in self._init_actions(name):
            if action.tag not in _STANDING:
                target = action.find("SpeedAction", "SpeedActionTarget", "AbsoluteTargetSpeed")
                if target is None or self._scope.number(target, "value") != 0.0:
                    return True
        return False

    def _is_routed(self, name: str) -> bool:
        return any(each.tag == "RoutingAction" for each in self._init_actions(name))

    def _init_actions(self, name: str) -> Iterator[XmlElement]:
        for private in self._storyboard.one("Init").below():
            if private.tag == "Private" and self._scope.text(private, "entityRef", "") == name:
                for action in private.all("PrivateAction"):
                    yield from action.children


def _actors(storyboard: XmlElement, scope: ParameterScope) -> Iterator[str]:
    """The entities that act in a story."""
    for part, inner in with_scopes(storyboard, scope):
        for actors in (each for each in part.below() if each.tag == "Actors"):
            for ref in actors.all("EntityRef"):
                yield inner.text(ref, "entityRef")


def _without_orientation(position: XmlElement) -> XmlElement:
    """The same position for what may face in any direction."""
    at = position.only()
    bare = XmlElement(
        at.file,
        at.tag,
        at.line,
        {key: "0" if key == "h" else value for key, value in at.attributes.items()},
        [each for each in at.children if each.tag != "Orientation"],
    )
    return XmlElement(position.file, position.tag, position.line, position.attributes, [bare])


def _met(stage: PlayedScenario) -> set[str]:
    """The roads of the way, and those through the same junctions."""
    roads = [stage.road.network.roads[number] for number in stage.road.road_ids]
    junctions = {road.junction for road in roads} - {None}
    return {road.id for road in roads} | {
        road.id for road in stage.road.network.roads.values() if road.junction in junctions
    }


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
