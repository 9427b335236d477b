"""Puts the entities of a scenario on the ego vehicle's road, on a road of their own or on a line, or leaves out what
the simulator does not have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pipeline.simulation.openscenario.elsewhere import is_on_other_level, may_meet, own_road
from pipeline.simulation.openscenario.entities import NO_EGO, VehicleBody
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad, OffTheWay
from pipeline.simulation.openscenario.roads.free_line import straight
from pipeline.simulation.openscenario.roads.network import Network
from pipeline.simulation.openscenario.storyboard.movers import Mover
from pipeline.simulation.openscenario.storyboard.poses import pose_at
from pipeline.simulation.openscenario.storyboard.positions import Entities, RoadPlace, place_at
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.storyboard.start import file_start, named_roads, with_scopes
from pipeline.simulation.openscenario.storyboard.trajectories import read_trajectory, trajectory_of
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, XmlElement, shown
from pipeline.simulation.world.lines import WorldPose

_AHEAD_STEP_M = 5.0
_STANDING = ("TeleportAction", "AppearanceAction", "ControllerAction", "ActivateControllerAction", "VisibilityAction")


class Placing:
    """The entities of one scenario."""

    def __init__(
        self,
        storyboard: XmlElement,
        scope: ParameterScope,
        bodies: Mapping[str, VehicleBody],
        own_ways: frozenset[str],
    ) -> None:
        """own_ways: entities that get a road of their own wherever they start."""
        self._storyboard, self._scope, self._bodies, self._own_ways = storyboard, scope, bodies, own_ways
        self._acting = set(_actors(storyboard, scope))
        self.teleports: dict[str, XmlElement] = {}
        """Entity → its position in the Init."""
        self.trajectories: dict[str, XmlElement] = {}
        """Entity → its first ``FollowTrajectoryAction`` in the Init."""
        self.ego_place: RoadPlace | None = None
        """Where the ego vehicle starts, if its trajectory says so."""
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
                trajectory = action.find("RoutingAction", "FollowTrajectoryAction")
                if trajectory is not None:
                    self.trajectories.setdefault(name, trajectory)

    def put_ego(self, stage: PlayedScenario) -> None:
        """Place the ego vehicle, and before it those to which its position refers."""
        self.put(stage.ego, stage, ())

    def put_all(self, stage: PlayedScenario) -> None:
        """Place every entity, each after those to which its position refers."""
        for name in self._bodies:
            self.put(name, stage, ())

    def put(self, name: str, stage: PlayedScenario, asked: tuple[str, ...]) -> None:
        """Place an entity, unless it is placed or not one of the file's. asked: who is waiting for it."""
        if name in stage.movers or name in stage.left_out or name not in self._bodies:
            return
        body, entities = self._bodies[name], _PlacedFirst(self, stage, (*asked, name))
        if name == stage.ego and self.ego_place is not None:
            stage.movers[name] = Mover(body, self.ego_place, stage.road, self.trajectories[name])
        elif name in self.teleports:
            self._put_at(self.teleports[name], body, stage, entities)
        elif name in self.trajectories:
            action = self.trajectories[name]
            found = read_trajectory(trajectory_of(action), self._scope, entities)
            offset_m = self._scope.number(action, "initialDistanceOffset", 0.0)
            stage.movers[name] = Mover.on_line(body, found.line, offset_m, stage.road, action)
        else:
            self._leave_out(stage, f"{shown(name)} is left out: it has no position at the start.", name)

    def _put_at(self, position: XmlElement, body: VehicleBody, stage: PlayedScenario, entities: _PlacedFirst) -> None:
        """Put an entity at its position in the Init."""
        name = body.name
        if body.kind is None:
            self._check_stranger(body, _without_orientation(position), stage, entities)
            return
        own_roads = named_roads(self._storyboard, name, self._scope)
        try:
            place = place_at(position, self._scope, stage.road, entities, on_road=body.kind not in NO_EGO)
            is_along = not self._is_routed(name) or own_roads <= stage.road.road_ids
            if name == stage.ego or (is_along and name not in self._own_ways):
                stage.movers[name] = Mover(body, place, stage.road, position)
                return
        except OffTheWay:
            if name == stage.ego:
                raise
        pose = entities.pose_at(position, self._scope)
        if not self._moves(name):
            stage.movers[name] = Mover.on_line(body, straight(pose), 0.0, stage.road, position)
            return
        try:
            own = own_road(pose, own_roads, stage.network)
        except OpenScenarioError as error:
            self._check_elsewhere(name, stage, error)
            return
        if own is None:
            stage.movers[name] = Mover.on_line(body, straight(pose), 0.0, stage.road, position)
        elif is_on_other_level(own, pose, stage.road):
            self._leave_out(stage, f"{shown(name)} is left out: it drives above or below the ego vehicle's road.", name)
        else:
            place = RoadPlace(*own.project(pose[0], pose[1]), 1)
            stage.movers[name] = Mover(body, place, own, position)

    def _check_stranger(
        self, body: VehicleBody, position: XmlElement, stage: PlayedScenario, entities: Entities
    ) -> None:
        """Leave out what stands or moves beside the driving lanes."""
        try:
            place = place_at(position, self._scope, stage.road, entities)
        except OffTheWay:
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

    def _check_elsewhere(self, name: str, stage: PlayedScenario, error: OpenScenarioError) -> None:
        """Leave out a vehicle on a road that cannot be simulated, if it never comes onto the way of the ego vehicle."""
        start = file_start(name, self.teleports, self._scope, stage.road.network)
        met = may_meet(start.road, stage.road)
        if met:
            raise OpenScenarioError(
                f"{error}, and {shown(name)} may come onto road {shown(met[0])}, which is on or across it"
            )
        self._leave_out(
            stage,
            f"{shown(name)} is left out: road {shown(start.road.id)}, where it drives, cannot be simulated.",
            name,
        )

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


class _PlacedFirst:
    """The entities to which a position refers, each placed when it is asked for."""

    def __init__(self, placing: Placing, stage: PlayedScenario, asked: tuple[str, ...]) -> None:
        """asked: who is waiting for them, the last one whose position this is."""
        self._placing, self._stage, self._asked = placing, stage, asked

    @property
    def network(self) -> Network:
        """All roads of the file."""
        return self._stage.network

    def place_of(self, name: str, at: XmlElement, road: DrivenRoad) -> RoadPlace:
        self._place(name, at)
        return self._stage.place_of(name, at, road)

    def pose_of(self, name: str, at: XmlElement) -> WorldPose:
        self._place(name, at)
        return self._stage.pose_of(name, at)

    def follows(self, name: str, at: XmlElement, road: DrivenRoad) -> bool:
        self._place(name, at)
        return self._stage.follows(name, at, road)

    def road_of(self, name: str, at: XmlElement) -> DrivenRoad:
        self._place(name, at)
        return self._stage.road_of(name, at)

    def pose_at(self, position: XmlElement, scope: ParameterScope) -> WorldPose:
        return pose_at(position, scope, self)

    def _place(self, name: str, at: XmlElement) -> None:
        if name in self._asked:
            raise at.refusal(f"the position of {shown(name)} refers to itself")
        self._placing.put(name, self._stage, self._asked)


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
