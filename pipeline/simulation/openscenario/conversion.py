"""Makes a scenario of the simulator from an OpenSCENARIO file: reads it, plays its storyboard with the ego vehicle on
its own script, and keeps the speeds and lane changes that this results in."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from pathlib import Path
from typing import Any

from pipeline.simulation.openscenario.catalogs import CatalogFiles
from pipeline.simulation.openscenario.coordinates import mirror_world_positions
from pipeline.simulation.openscenario.entities import ego_name, read_entities, with_controllers
from pipeline.simulation.openscenario.free_parts import free_actor, is_free
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.placing import Placing
from pipeline.simulation.openscenario.roads.building import driven_road
from pipeline.simulation.openscenario.roads.crossing_roads import crossing_roads
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.roads.free_line import turned_rad
from pipeline.simulation.openscenario.roads.network import Network
from pipeline.simulation.openscenario.storyboard.actions import start_action
from pipeline.simulation.openscenario.storyboard.lane_drift import LaneDrift, LaneShift
from pipeline.simulation.openscenario.storyboard.movers import Mover
from pipeline.simulation.openscenario.storyboard.running import STEP_S
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.storyboard.start import NoEntities, ego_way, file_start, named_roads
from pipeline.simulation.openscenario.storyboard.storyboard import Storyboard
from pipeline.simulation.openscenario.storyboard.trajectories import Trajectory, read_trajectory, trajectory_of
from pipeline.simulation.openscenario.variants import Variants
from pipeline.simulation.openscenario.xml_files import XmlElement, named_path, read_xml, shown
from pipeline.simulation.world.lines import WorldPose
from pipeline.simulation.world.roads import Road

_LONGEST_S = 120.0
"""Duration of a scenario that no StopTrigger ends."""
_BRIEFEST_S = 1.0
_WIDEST_SHOULDER_M = 10.0


def convert(path: Path, variant: int | None, given: Mapping[str, str], ego: str | None = None) -> dict[str, Any]:
    """The keys of a ``Scenario`` from a file, which may be a distribution of parameter values with its scenario beside
    it. variant: which of its variants, from 1; given: values of parameters by name; ego: which entity is the ego
    vehicle. OpenScenarioError says in one sentence what is wrong, or what cannot be simulated."""
    root, values, title = read_xml(path, "OpenSCENARIO"), dict(given), path.stem
    variants, distribution = None, root.find("ParameterValueDistribution")
    if distribution is not None:
        variants = Variants(distribution, given)
        values = variants.values(1 if variant is None else variant)
        title = f"{title} · variant {variant}" if variant is not None else title
        path = named_path(path.parent, distribution.one("ScenarioFile").attributes.get("filepath", ""))
        root = read_xml(path, "OpenSCENARIO")
    elif variant is not None:
        raise root.refusal("it has no variants: it is a scenario, not a ParameterValueDistribution")
    if root.find("Storyboard") is None:
        raise root.refusal("no Storyboard: it is not a scenario")
    if root.find("Entities", "Object") is not None:
        raise root.refusal("it is written for OpenSCENARIO 0.9; versions 1.0 to 1.3 are supported")
    made = _made(root, path.parent, values, ego, title)
    if variants is not None and variant is None:
        variants.check_single()  # last: what cannot be simulated at all need not be chosen from
    return made


def _made(root: XmlElement, folder: Path, values: Mapping[str, str], ego: str | None, title: str) -> dict[str, Any]:
    """The keys of a scenario. Vehicles whose lanes do not run parallel to the ego vehicle's get roads of their own."""
    notes, own_ways = mirror_world_positions(root), set[str]()
    while True:
        try:
            return _Conversion(root, folder, values, ego, notes, frozenset(own_ways)).scenario(title)
        except LaneShift as shift:
            if shift.name in own_ways:
                raise
            own_ways.add(shift.name)


class _Conversion:
    """One scenario file with its parameters."""

    def __init__(
        self,
        root: XmlElement,
        folder: Path,
        values: Mapping[str, str],
        ego: str | None,
        notes: list[str],
        own_ways: frozenset[str],
    ) -> None:
        self._root, self._scope = root, ParameterScope()
        self._scope.declare(root, values)
        self._catalogs = CatalogFiles(root, self._scope, folder)
        self._storyboard = self._catalogs.expanded(root.one("Storyboard"), self._scope)
        self._bodies = read_entities(root, self._scope, self._catalogs)
        name, guess = ego_name(root, self._bodies, ego)
        notes = [*notes, *([guess] if guess is not None else [])]
        self._placing = Placing(self._storyboard, self._scope, self._bodies, own_ways)
        self._placing.check_kinds(name)
        self._placing.read_init()
        logic = root.one("RoadNetwork", "LogicFile")
        network = Network(read_xml(named_path(folder, self._scope.text(logic, "filepath")), "OpenDRIVE"))
        road, is_own = self._road(network, name)
        self._stage = PlayedScenario(road, ego=name, notes=[*notes, *road.notes], has_trajectory=is_own)
        self._stage.controlled = set(with_controllers(root))
        declared = root.find("VariableDeclarations")
        for each in declared.all("VariableDeclaration") if declared is not None else []:
            self._stage.variables[self._scope.text(each, "name")] = self._scope.text(each, "value")

    def _road(self, network: Network, ego: str) -> tuple[DrivenRoad, bool]:
        """The way of the ego vehicle, in the direction in which it faces, and whether a trajectory in the Init gives
        it."""
        teleports, action = self._placing.teleports, self._placing.trajectories.get(ego)
        wanted = named_roads(self._storyboard, ego, self._scope)
        if action is not None and (ego not in teleports or action.find("TimeReference", "Timing") is None):
            files = NoEntities(network)
            trajectory = read_trajectory(trajectory_of(action), self._scope, files)
            start_m = self._scope.number(action, "initialDistanceOffset", 0.0)
            if ego in teleports:
                self._check_direction(trajectory, start_m, files.pose_at(teleports[ego], self._scope), ego)
            road, self._placing.ego_place = ego_way(trajectory, start_m, network, wanted, ego)
            return road, True
        if ego not in teleports:
            raise self._root.refusal(f"the ego vehicle {shown(ego)} has no position in Init, or no trajectory there")
        start = file_start(ego, teleports, self._scope, network)
        lane = start.driven_lane()
        way = start.road.traffic_way(lane)
        road = driven_road(network, start.road, start.s_m, lane, way, wanted)
        stage = PlayedScenario(road, ego=ego)
        self._placing.put_ego(stage)
        if stage.movers[ego].way > 0:
            return road, False
        return driven_road(network, start.road, start.s_m, lane, -way, wanted), False

    @staticmethod
    def _check_direction(trajectory: Trajectory, start_m: float, pose: WorldPose, ego: str) -> None:
        if turned_rad(trajectory.line.pose(start_m)[2], pose[2]) > pi / 2:
            raise trajectory.at.refusal(
                f"the trajectory of {shown(ego)} leads behind it, and driving backwards is not supported"
            )

    def scenario(self, title: str) -> dict[str, Any]:
        """The keys of a ``Scenario``."""
        stage = self._stage
        self._set_up()
        duration_s = self._play(Storyboard(self._storyboard, self._scope, self._catalogs, stage))
        ego = stage.movers[stage.ego]
        if not any(ego.script.speed_mps.values()):
            stage.note("The ego vehicle stands throughout: the file gives it no speed.")
        nose_m = ego.start_s_m + ego.body.size_m[0] / 2
        others = list(enumerate((each for each in stage.movers.values() if each is not ego), start=1))
        return {
            "title": title,
            "duration_s": duration_s,
            "road": self._paved(stage.road.road).model_copy(update={"crossings": crossing_roads(stage.road)}),
            "ego": {**ego.script.model_dump(), "start_m": nose_m},
            "actors": [self._actor(number, each, nose_m) for number, each in others if not is_free(each, stage)],
            "free_actors": [
                free_actor(number, each, stage.road, duration_s) for number, each in others if is_free(each, stage)
            ],
            "notes": stage.notes,
        }

    def _paved(self, road: Road) -> Road:
        """The road with shoulders as wide as its vehicles need: lanes that begin later are not drawn."""
        edges = [edge for pair in road.edges_m() for edge in pair]
        beyond = [
            max(d_m - max(edges), min(edges) - d_m) + mover.body.size_m[1]
            for mover in self._stage.movers.values()
            if mover.line is None and mover.road is self._stage.road and mover.body.kind != "pedestrian"
            for d_m in mover.offsets_m()
        ]
        needed = min(max(beyond, default=0.0), _WIDEST_SHOULDER_M)
        return road if needed <= road.shoulder_m else road.model_copy(update={"shoulder_m": needed})

    def _actor(self, number: int, mover: Mover, nose_m: float) -> dict[str, Any]:
        """``ahead_m`` is to the face that is nearer to the ego vehicle's nose."""
        half, middle = mover.body.size_m[0] / 2, mover.start_s_m - nose_m
        alongside = -half <= middle < half
        ahead = middle + half if alongside or middle < 0.0 else middle - half
        return {
            **mover.script.model_dump(),
            "id": number,
            "kind": mover.body.kind,
            "size_m": mover.body.size_m,
            "ahead_m": ahead,
            "alongside": alongside,
        }

    def _set_up(self) -> None:
        """The Init: first every position, as they may refer to one another in any order; then the other actions."""
        self._placing.put_all(self._stage)
        for action, actors in self._placing.others:
            start_action(action, actors, self._scope, self._stage)

    def _play(self, storyboard: Storyboard) -> float:
        """Play until the StopTrigger fires or the ego vehicle leaves the road; returns when that is."""
        stage = self._stage
        ego, drift = stage.movers[stage.ego], LaneDrift()
        for step in range(round(_LONGEST_S / STEP_S) + 1):
            stage.t_s = step * STEP_S
            if storyboard.step(stage):
                return max(stage.t_s, _BRIEFEST_S)
            if ego.now(stage.t_s)[0] > stage.road.length_m:
                last = f"leaves road {shown(stage.road.last_road)}"
                last = "has followed its trajectory" if stage.road.tracks[-1].is_free else last
                stage.note(f"The drive ends where the ego vehicle {last}.")
                return max(stage.t_s, _BRIEFEST_S)
            drift.check(stage)
            stage.step_controls()
        stage.note(f"No StopTrigger of the scenario fired within {_LONGEST_S:g} s, so the drive ends then.")
        return _LONGEST_S
