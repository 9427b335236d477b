"""Makes a scenario of the simulator from an OpenSCENARIO file: reads it, plays its storyboard with the ego vehicle on
its own script, and keeps the speeds and lane changes that this results in."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline.simulation.openscenario.actions import start_action
from pipeline.simulation.openscenario.entities import CatalogFiles, VehicleBody, ego_name, read_entities
from pipeline.simulation.openscenario.movers import Mover
from pipeline.simulation.openscenario.opendrive import DrivenRoad, road_of
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.positions import RoadPlace, place_at
from pipeline.simulation.openscenario.stage import PlayedScenario
from pipeline.simulation.openscenario.storyboard import STEP_S, Storyboard
from pipeline.simulation.openscenario.variants import Variants
from pipeline.simulation.openscenario.xml_files import XmlElement, read_xml, shown

_LONGEST_S = 120.0
"""Duration of a scenario that no StopTrigger ends."""
_BRIEFEST_S = 1.0


def convert(path: Path, variant: int | None, given: Mapping[str, str]) -> dict[str, Any]:
    """The keys of a ``Scenario`` from a file, which may be a distribution of parameter values with its scenario beside
    it. variant: which of its variants, from 1; given: values of parameters by name. OpenScenarioError says in one
    sentence what is wrong, or what cannot be simulated."""
    root, values, title = read_xml(path, "OpenSCENARIO"), dict(given), path.stem
    variants, distribution = None, root.find("ParameterValueDistribution")
    if distribution is not None:
        variants = Variants(distribution, given)
        values = variants.values(1 if variant is None else variant)
        title = f"{title} · variant {variant}" if variant is not None else title
        file = distribution.one("ScenarioFile").attributes.get("filepath", "")
        path = path.parent / file.replace("\\", "/")
        root = read_xml(path, "OpenSCENARIO")
    elif variant is not None:
        raise root.refusal("it has no variants: it is a scenario, not a ParameterValueDistribution")
    if root.find("Storyboard") is None:
        raise root.refusal("no Storyboard: it is not a scenario")
    made = _Conversion(root, path.parent, values).scenario(title)
    if variants is not None and variant is None:
        variants.check_single()  # last: what cannot be simulated at all need not be chosen from
    return made


class _Conversion:
    """One scenario file with its parameters."""

    def __init__(self, root: XmlElement, folder: Path, values: Mapping[str, str]) -> None:
        self._root, self._scope = root, ParameterScope()
        self._scope.declare(root, values)
        self._catalogs = CatalogFiles(root, self._scope, folder)
        self._bodies = read_entities(root, self._scope, self._catalogs)
        ego = ego_name(root, self._bodies)
        self._refuse_routes()
        logic = root.one("RoadNetwork", "LogicFile")
        file = folder / self._scope.text(logic, "filepath").replace("\\", "/")
        self._stage = PlayedScenario(self._road(file), ego=ego)
        declared = root.find("VariableDeclarations")
        for each in declared.all("VariableDeclaration") if declared is not None else []:
            self._stage.variables[self._scope.text(each, "name")] = self._scope.text(each, "value")

    def _refuse_routes(self) -> None:
        """Before positions are missed that a route would give."""
        for private in self._root.one("Storyboard", "Init").below():
            if private.tag == "RoutingAction" and private.children:
                what = shown(private.children[0].tag)
                raise private.refusal(f"{what} is not supported: vehicles keep to the lanes of one road")

    def _road(self, file: Path) -> DrivenRoad:
        """The one road that positions name."""
        wanted = set()
        for each in self._root.below():
            if "roadId" in each.attributes:
                wanted.add(self._scope.text(each, "roadId"))
        if len(wanted) > 1:
            names = shown(", ".join(sorted(wanted)))
            raise self._root.refusal(f"positions on several roads ({names}) are not supported; one road is")
        return road_of(read_xml(file, "OpenDRIVE"), wanted.pop() if wanted else None)

    def scenario(self, title: str) -> dict[str, Any]:
        """The keys of a ``Scenario``."""
        stage = self._stage
        self._set_up()
        duration_s = self._play(Storyboard(self._root.one("Storyboard"), self._scope, self._catalogs, stage))
        ego = stage.movers[stage.ego]
        if ego.way < 0:
            raise self._root.refusal("the ego vehicle drives against its road's direction; use a lane below 0")
        nose_m = ego.start_s_m + ego.body.size_m[0] / 2
        actors = [
            self._actor(number, mover, nose_m)
            for number, mover in enumerate((each for each in stage.movers.values() if each is not ego), start=1)
        ]
        return {
            "title": title,
            "duration_s": duration_s,
            "road": stage.road.road,
            "ego": {**ego.script.model_dump(), "start_m": nose_m},
            "actors": actors,
            "notes": stage.notes,
        }

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
        stage, inits = self._stage, self._root.one("Storyboard", "Init").find("Actions")
        private = inits.all("Private") if inits is not None else []
        teleports: dict[str, XmlElement] = {}
        others: list[tuple[XmlElement, list[str]]] = []
        for each in private:
            name = self._scope.text(each, "entityRef")
            if name not in self._bodies:
                raise each.refusal(f"no entity {shown(name)!r}")
            for action in each.all("PrivateAction"):
                teleport = action.find("TeleportAction")
                if teleport is not None:
                    teleports[name] = teleport.one("Position")
                else:
                    others.append((action, [name]))
        for name, body in self._bodies.items():
            self._put(name, body, teleports, ())
        for action in inits.all("GlobalAction") if inits is not None else []:
            start_action(action, [], self._scope, stage)
        for action, actors in others:
            start_action(action, actors, self._scope, stage)

    def _put(self, name: str, body: VehicleBody, teleports: Mapping[str, XmlElement], asked: tuple[str, ...]) -> None:
        """Place an entity, and before it those to which its position refers. asked: who is waiting for it."""
        if name in self._stage.movers:
            return
        if name not in teleports:
            if name == self._stage.ego:
                raise self._root.refusal(f"the ego vehicle {shown(name)} has no TeleportAction in Init")
            self._stage.note(f"{shown(name)} is left out: it has no position at the start.")
            return

        def place_of(other: str, at: XmlElement) -> RoadPlace:
            if other in (name, *asked):
                raise at.refusal(f"the position of {shown(other)} refers to itself")
            if other in self._bodies:
                self._put(other, self._bodies[other], teleports, (*asked, name))
            return self._stage.place_of(other, at)

        position = teleports[name]
        place = place_at(position, self._scope, self._stage.road, place_of)
        self._stage.movers[name] = Mover(body, place, self._stage.road, position)

    def _play(self, storyboard: Storyboard) -> float:
        """Play until the StopTrigger fires or the ego vehicle leaves the road; returns when that is."""
        stage = self._stage
        ego = stage.movers[stage.ego]
        for step in range(round(_LONGEST_S / STEP_S) + 1):
            stage.t_s = step * STEP_S
            if storyboard.step(stage):
                return max(stage.t_s, _BRIEFEST_S)
            if ego.now(stage.t_s)[0] > stage.road.length_m:
                stage.note(f"The drive ends where the ego vehicle leaves road {shown(stage.road.id)}.")
                return max(stage.t_s, _BRIEFEST_S)
        stage.note(f"No StopTrigger of the scenario fired within {_LONGEST_S:g} s, so the drive ends then.")
        return _LONGEST_S
