"""Plays a storyboard at small steps: acts, maneuver groups, maneuvers and events with their triggers."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.simulation.openscenario.catalogs import CatalogFiles
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.storyboard.actions import start_action
from pipeline.simulation.openscenario.storyboard.conditions import Trigger
from pipeline.simulation.openscenario.storyboard.running import STEP_S, Running
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.xml_files import XmlElement, shown

_MOST_EVENTS = 500
_MOST_CONDITIONS = 500
"""Limits for files of unknown origin; playing two minutes then takes under a minute. Euro NCAP's have under ten."""
_REPLACES = ("override", "overwrite")


class Storyboard:
    """The acts of a storyboard and its StopTrigger."""

    def __init__(self, at: XmlElement, scope: ParameterScope, catalogs: CatalogFiles, stage: PlayedScenario) -> None:
        self._acts: list[_Act] = []
        for story in at.all("Story"):
            inner = ParameterScope(scope.values)
            inner.declare(story, {})
            stage.register("story", scope.text(story, "name"))
            self._acts += [_Act(act, inner, catalogs, stage) for act in story.all("Act")]
        self._stop = _trigger(at.find("StopTrigger"), scope)
        events = sum(1 for act in self._acts for _ in act.events())
        if events > _MOST_EVENTS or sum(1 for each in at.below() if each.tag == "Condition") > _MOST_CONDITIONS:
            raise at.refusal(f"more than {_MOST_EVENTS} events or {_MOST_CONDITIONS} conditions")

    def step(self, stage: PlayedScenario) -> bool:
        """One step at the stage's time; whether the StopTrigger ends the scenario."""
        for act in self._acts:
            act.step(stage)
        return self._stop is not None and self._stop.fires(stage)


def _trigger(at: XmlElement | None, scope: ParameterScope) -> Trigger | None:
    """None if it is missing or empty: for a start, that is at once; for a stop, never."""
    return Trigger(at, scope, STEP_S) if at is not None and at.children else None


class _Act:
    def __init__(self, at: XmlElement, scope: ParameterScope, catalogs: CatalogFiles, stage: PlayedScenario) -> None:
        self._name = scope.text(at, "name")
        stage.register("act", self._name)
        self._groups = [_ManeuverGroup(each, scope, catalogs, stage) for each in at.all("ManeuverGroup")]
        self._start, self._stop = (_trigger(at.find(name), scope) for name in ("StartTrigger", "StopTrigger"))
        self._state = "standby"

    def events(self) -> Iterator[_Event]:
        for group in self._groups:
            yield from group.events()

    def step(self, stage: PlayedScenario) -> None:
        if self._state == "standby" and (self._start is None or self._start.fires(stage)):
            self._enter(stage, "running", "start")
        if self._state != "running":
            return
        if self._stop is not None and self._stop.fires(stage):
            for event in self.events():
                event.stop(stage)
            self._enter(stage, "complete", "stop")
            return
        for group in self._groups:
            group.step(stage)
        if all(group.is_complete for group in self._groups):
            self._enter(stage, "complete", "end")

    def _enter(self, stage: PlayedScenario, state: str, transition: str) -> None:
        self._state = state
        stage.enter("act", self._name, state, transition)


class _ManeuverGroup:
    def __init__(self, at: XmlElement, scope: ParameterScope, catalogs: CatalogFiles, stage: PlayedScenario) -> None:
        self._at, self._name = at, scope.text(at, "name")
        self._times = scope.number(at, "maximumExecutionCount", 1.0)
        stage.register("maneuverGroup", self._name)
        actors = at.one("Actors")
        if scope.truth(actors, "selectTriggeringEntities", False):
            raise actors.refusal("selectTriggeringEntities=true is not supported; name the actors")
        names = [scope.text(each, "entityRef") for each in actors.all("EntityRef")]
        self._maneuvers = []
        for each in at.children:
            if each.tag == "CatalogReference":
                maneuver, inner = catalogs.entry(each, scope)
                if maneuver.tag != "Maneuver":
                    raise each.refusal(f"expected a Maneuver in the catalog instead of {shown(maneuver.tag)}")
                self._maneuvers.append(_Maneuver(catalogs.expanded_inside(maneuver, inner), names, inner, stage))
            elif each.tag == "Maneuver":
                inner = ParameterScope(scope.values)
                inner.declare(each, {})
                self._maneuvers.append(_Maneuver(each, names, inner, stage))
        self.is_complete = False

    def events(self) -> Iterator[_Event]:
        for maneuver in self._maneuvers:
            yield from maneuver.events

    def step(self, stage: PlayedScenario) -> None:
        if self.is_complete:
            return
        if stage.states["maneuverGroup", self._name] == "standby":
            stage.enter("maneuverGroup", self._name, "running", "start")
        for maneuver in self._maneuvers:
            maneuver.step(stage)
        if all(maneuver.is_complete for maneuver in self._maneuvers):
            if self._times > 1.0 and self._maneuvers:
                raise self._at.refusal("a ManeuverGroup that is repeated is not supported; set maximumExecutionCount=1")
            self.is_complete = True
            stage.enter("maneuverGroup", self._name, "complete", "end")


class _Maneuver:
    def __init__(self, at: XmlElement, actors: list[str], scope: ParameterScope, stage: PlayedScenario) -> None:
        self._name = scope.text(at, "name")
        stage.register("maneuver", self._name)
        self.events = [_Event(each, actors, scope, stage) for each in at.all("Event")]
        self.is_complete = self._is_running = False

    def step(self, stage: PlayedScenario) -> None:
        if self.is_complete:
            return
        if not self._is_running:
            self._is_running = True
            stage.enter("maneuver", self._name, "running", "start")
        for event in self.events:
            event.step(stage, self.events)
        if all(event.is_complete for event in self.events):
            self.is_complete = True
            stage.enter("maneuver", self._name, "complete", "end")


class _Event:
    def __init__(self, at: XmlElement, actors: list[str], scope: ParameterScope, stage: PlayedScenario) -> None:
        self._at, self._actors, self._scope, self._name = at, actors, scope, scope.text(at, "name")
        self._priority = scope.text(at, "priority", "override")
        self._left = round(scope.number(at, "maximumExecutionCount", 1.0))
        stage.register("event", self._name)
        self._actions = [(scope.text(each, "name"), each.only()) for each in at.all("Action")]
        for name, _ in self._actions:
            stage.register("action", name)
        self._start = _trigger(at.find("StartTrigger"), scope)
        self._running: list[tuple[str, list[Running]]] | None = None
        self.is_complete = False

    def step(self, stage: PlayedScenario, others: list[_Event]) -> None:
        fires = not self.is_complete and (self._start is None or self._start.fires(stage))
        if self._running is None and fires:
            self._begin(stage, others)
        if self._running is None:
            return
        over = [name for name, actions in self._running if all(each.is_over(stage.t_s) for each in actions)]
        self._running = [each for each in self._running if each[0] not in over]
        for name in over:
            stage.enter("action", name, "complete", "end")
        if not self._running:
            self._finish(stage, "end")

    def _begin(self, stage: PlayedScenario, others: list[_Event]) -> None:
        busy = [each for each in others if each is not self and each._running is not None]
        if self._priority == "skip" and busy:
            self._left -= 1
            stage.enter("event", self._name, "standby" if self._left > 0 else "complete", "skip")
            self.is_complete = self._left <= 0
            return
        for each in busy if self._priority in _REPLACES else []:
            each.stop(stage)
        stage.enter("event", self._name, "running", "start")
        self._running = []
        for name, action in self._actions:
            stage.enter("action", name, "running", "start")
            self._running.append((name, start_action(action, self._actors, self._scope, stage)))

    def stop(self, stage: PlayedScenario) -> None:
        """End it before it is complete."""
        for name, actions in self._running or []:
            for each in actions:
                each.stop(stage.t_s, self._at)
            stage.enter("action", name, "complete", "stop")
        self._left = 0
        if not self.is_complete:
            self._finish(stage, "stop")

    def _finish(self, stage: PlayedScenario, transition: str) -> None:
        self._running = None
        self._left -= 1
        self.is_complete = self._left <= 0
        stage.enter("event", self._name, "complete" if self.is_complete else "standby", transition)
