"""Triggers: groups of conditions, each with an edge and a delay."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import hypot, inf

from pipeline.simulation.openscenario.parameters import RULES, ParameterScope, compare
from pipeline.simulation.openscenario.roads.free_line import turned_rad
from pipeline.simulation.openscenario.storyboard.positions import ON_ROADS, RoadPlace, file_point, place_at
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.xml_files import XmlElement, shown

Test = Callable[[PlayedScenario], bool]
"""Whether a condition holds now, before its edge and delay."""

_BY_VALUE = "SimulationTimeCondition, ParameterCondition, VariableCondition and StoryboardElementStateCondition are"
_BY_ENTITY = (
    "TimeHeadway, TimeToCollision, RelativeDistance, Distance, ReachPosition, Speed, RelativeSpeed, StandStill, "
    "TraveledDistance, Collision, Acceleration, Angle, EndOfRoad and OffroadCondition are"
)
_STANDSTILL_MPS = 0.01
"""Speeds below it count as standing: wheel-speed sensors report 0 below a few cm/s."""


class Trigger:
    """A StartTrigger or StopTrigger: any of its groups, of which all conditions must hold in the same step."""

    def __init__(self, at: XmlElement, scope: ParameterScope, step_s: float) -> None:
        self._groups = [
            [_TimedCondition(each, scope, step_s) for each in group.all("Condition") if not _is_criterion(each)]
            for group in at.all("ConditionGroup")
        ]

    def fires(self, stage: PlayedScenario) -> bool:
        """Call once per step. Every condition is asked every time, as edges and delays need its past."""
        held = [[condition.holds(stage) for condition in group] for group in self._groups]
        return any(group and all(group) for group in held)


def _is_criterion(at: XmlElement) -> bool:
    """Whether it is what CARLA's ScenarioRunner judges a run by, written as a condition of the StopTrigger."""
    return at.attributes.get("name", "").startswith("criteria_")


class _TimedCondition:
    """One condition with its edge and delay."""

    def __init__(self, at: XmlElement, scope: ParameterScope, step_s: float) -> None:
        self._edge = scope.text(at, "conditionEdge", "none")
        if self._edge not in ("none", "rising", "falling", "risingOrFalling"):
            raise at.refusal(f"unknown conditionEdge {shown(self._edge)!r}")
        delay = scope.number(at, "delay", 0.0)
        if delay < 0.0:
            raise at.refusal("a negative delay")
        self._test = _test_of(at, scope)
        self._delay, self._past = round(delay / step_s), deque[bool]()
        self._before: bool | None = None

    def holds(self, stage: PlayedScenario) -> bool:
        """Whether it held with its edge, its delay ago."""
        now = self._test(stage)
        if self._edge == "none" and not self._delay:  # most conditions
            return now
        rose, fell = self._before is False and now, self._before is True and not now
        self._before = now
        edged = {"none": now, "rising": rose, "falling": fell, "risingOrFalling": rose or fell}[self._edge]
        self._past.append(edged)
        return self._past.popleft() if len(self._past) > self._delay else False


def _test_of(at: XmlElement, scope: ParameterScope) -> Test:
    by_value, by_entity = at.find("ByValueCondition"), at.find("ByEntityCondition")
    if by_value is not None:
        return _by_value(by_value.only(), scope)
    if by_entity is None:
        raise at.refusal("Condition has neither ByValueCondition nor ByEntityCondition")
    who = by_entity.one("TriggeringEntities")
    names = [scope.text(each, "entityRef") for each in who.all("EntityRef")]
    every = scope.text(who, "triggeringEntitiesRule", "any") == "all"
    of_one = _by_entity(by_entity.one("EntityCondition").only(), scope)
    return lambda stage: (all if every else any)(of_one(stage, name) for name in names)


def _by_value(at: XmlElement, scope: ParameterScope) -> Test:
    if at.tag == "SimulationTimeCondition":
        limit = _limit(at, scope)
        return lambda stage: limit(stage.t_s)
    if at.tag == "ParameterCondition":
        name, rule, value = (scope.text(at, key) for key in ("parameterRef", "rule", "value"))
        if name not in scope.values:
            raise at.refusal(f"no parameter {shown(name)!r} is declared")
        compare(scope.values[name], rule, value, at)  # a wrong rule is told at once
        return lambda stage: compare(stage.assigned.get(name, scope.values[name]), rule, value, at)
    if at.tag == "VariableCondition":
        name, rule, value = (scope.text(at, key) for key in ("variableRef", "rule", "value"))

        def of_variable(stage: PlayedScenario) -> bool:
            if name not in stage.variables:
                raise at.refusal(f"no variable {shown(name)!r} is declared")
            return compare(stage.variables[name], rule, value, at)

        return of_variable
    if at.tag == "StoryboardElementStateCondition":
        kind, name, state = (scope.text(at, key) for key in ("storyboardElementType", "storyboardElementRef", "state"))
        return lambda stage: _in_state(stage, at, (kind, name), state)
    raise at.refusal(f"{shown(at.tag)} is not supported; {_BY_VALUE}")


def _in_state(stage: PlayedScenario, at: XmlElement, key: tuple[str, str], state: str) -> bool:
    """Whether a storyboard element is in a state, or made a transition in this step."""
    key = (key[0], key[1].split("::")[-1])
    if key in stage.ambiguous:
        raise at.refusal(f"several elements of type {shown(key[0])} are called {shown(key[1])!r}")
    if key not in stage.states:
        raise at.refusal(f"no {shown(key[0])} {shown(key[1])!r} in the storyboard")
    if state.endswith("State"):
        return stage.states[key] == state.removesuffix("State")
    return stage.changed.get(key) == (state.removesuffix("Transition"), stage.t_s)


def _by_entity(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    reader = _ENTITY_CONDITIONS.get(at.tag)
    if reader is None:
        raise at.refusal(f"{shown(at.tag)} is not supported; {_BY_ENTITY}")
    return reader(at, scope)


def _limit(at: XmlElement, scope: ParameterScope) -> Callable[[float], bool]:
    """Compares a number with the condition's value."""
    rule, value = scope.text(at, "rule", "greaterOrEqual"), scope.number(at, "value")
    if rule not in RULES:
        raise at.refusal(f"unknown rule {shown(rule)!r}")
    return lambda number: RULES[rule](number, value)


def _headway(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    """Distance divided by the entity's speed."""
    limit, other = _limit(at, scope), scope.text(at, "entityRef")
    kind, freespace = _distance_type(at, scope), scope.truth(at, "freespace", False)

    def test(stage: PlayedScenario, name: str) -> bool:
        speed, gap = stage.speed(name, at), stage.gap_m(name, other, kind, freespace, at)
        return limit(gap / speed if speed > 0.0 else inf)

    return test


def _time_to_collision(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    """Distance along the road divided by the closing speed; never while the gap grows."""
    limit, target = _limit(at, scope), at.one("TimeToCollisionConditionTarget").only()
    if target.tag != "EntityRef":
        raise target.refusal(f"time to collision with a {shown(target.tag)} is not supported; an EntityRef is")
    other, freespace = scope.text(target, "entityRef"), scope.truth(at, "freespace", False)

    def test(stage: PlayedScenario, name: str) -> bool:
        closing = stage.closing_mps(name, other, at)
        gap = stage.gap_m(name, other, "longitudinal", freespace, at)
        return limit(gap / closing if closing > 0.0 else inf)

    return test


def _relative_distance(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    limit, other = _limit(at, scope), scope.text(at, "entityRef")
    kind, freespace = scope.text(at, "relativeDistanceType"), scope.truth(at, "freespace", False)
    return lambda stage, name: limit(stage.gap_m(name, other, kind, freespace, at))


def _distance_type(at: XmlElement, scope: ParameterScope) -> str:
    """``alongRoute`` is what versions before 1.1 had instead."""
    usual = "longitudinal" if scope.truth(at, "alongRoute", False) else "euclidianDistance"
    return scope.text(at, "relativeDistanceType", usual)


def _to_position(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], float]:
    """Distance of an entity's reference point from a position: in the plane, or along or across the way."""
    position, kind = at.one("Position"), _distance_type(at, scope)
    is_fixed = not position.only().tag.startswith("Relative")
    known: list[RoadPlace] = []
    points: list[tuple[float, float]] = []

    def target(stage: PlayedScenario) -> RoadPlace:
        if not known or not is_fixed:
            known[:] = [place_at(position, scope, stage.road, stage, on_road=False)]
        return known[0]

    def in_plane(stage: PlayedScenario, name: str) -> float:
        x, y, _ = stage.pose_of(name, at)
        if not points or not is_fixed:
            points[:] = [point(stage)]
        return hypot(x - points[0][0], y - points[0][1])

    def point(stage: PlayedScenario) -> tuple[float, float]:
        if position.only().tag in ON_ROADS:
            return file_point(position.only(), scope, stage.road.network)
        return stage.pose_at(position, scope)[:2]

    def in_lane(stage: PlayedScenario, name: str) -> float:
        here, there = stage.place_of(name, at), target(stage)
        return abs(here.s_m - there.s_m) if kind == "longitudinal" else abs(here.d_m - there.d_m)

    return in_lane if kind in ("longitudinal", "lateral") else in_plane


def _distance(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    if scope.truth(at, "freespace", False):
        raise at.refusal("DistanceCondition with freespace=true is not supported")
    limit, distance = _limit(at, scope), _to_position(at, scope)
    return lambda stage, name: limit(distance(stage, name))


def _reach_position(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    tolerance, distance = scope.number(at, "tolerance"), _to_position(at, scope)
    return lambda stage, name: distance(stage, name) <= tolerance


def _speed(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    limit = _limit(at, scope)
    return lambda stage, name: limit(stage.speed(name, at))


def _relative_speed(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    limit, other = _limit(at, scope), scope.text(at, "entityRef")
    return lambda stage, name: limit(stage.speed(name, at) - stage.speed(other, at))


def _standstill(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    scope.number(at, "duration")
    return _for_seconds(at, scope, lambda stage, name: stage.speed(name, at) <= _STANDSTILL_MPS)


def _acceleration(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    if scope.text(at, "direction", "longitudinal") != "longitudinal":
        raise at.refusal("AccelerationCondition is supported along the road only")
    limit = _limit(at, scope)
    return lambda stage, name: limit(stage.mover(name, at).now(stage.t_s)[1].accel_mps2)


def _angle(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    """Whether an entity's heading in the file's world is within a tolerance of an angle."""
    if scope.text(at, "angleType", "heading") != "heading" or scope.text(at, "coordinateSystem", "world") != "world":
        raise at.refusal("AngleCondition is supported for the heading in the world only")
    angle, tolerance = scope.number(at, "angle"), scope.number(at, "angleTolerance")
    return lambda stage, name: turned_rad(stage.pose_of(name, at)[2], angle) <= tolerance


def _for_seconds(
    at: XmlElement, scope: ParameterScope, holds: Callable[[PlayedScenario, str], bool]
) -> Callable[[PlayedScenario, str], bool]:
    """Whether something has held for the condition's duration."""
    duration = scope.number(at, "duration", 0.0)
    since: dict[str, float] = {}

    def test(stage: PlayedScenario, name: str) -> bool:
        if not holds(stage, name):
            since.pop(name, None)
            return False
        return stage.t_s - since.setdefault(name, stage.t_s) >= duration

    return test


def _end_of_road(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    return _for_seconds(at, scope, lambda stage, name: stage.is_beyond_road(name, at))


def _offroad(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    """Vehicles keep to the road, so this never holds."""
    return lambda stage, name: False


def _travelled(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    value = scope.number(at, "value")
    return lambda stage, name: stage.mover(name, at).now(stage.t_s)[1].travelled_m >= value


def _collision(at: XmlElement, scope: ParameterScope) -> Callable[[PlayedScenario, str], bool]:
    target = at.only()
    if target.tag != "EntityRef":
        raise target.refusal(f"collision with a {shown(target.tag)} is not supported; an EntityRef is")
    other = scope.text(target, "entityRef")
    return lambda stage, name: stage.touch(name, other, at)


_ENTITY_CONDITIONS: dict[str, Callable[[XmlElement, ParameterScope], Callable[[PlayedScenario, str], bool]]] = {
    "TimeHeadwayCondition": _headway,
    "TimeToCollisionCondition": _time_to_collision,
    "RelativeDistanceCondition": _relative_distance,
    "DistanceCondition": _distance,
    "ReachPositionCondition": _reach_position,
    "SpeedCondition": _speed,
    "RelativeSpeedCondition": _relative_speed,
    "StandStillCondition": _standstill,
    "TraveledDistanceCondition": _travelled,
    "CollisionCondition": _collision,
    "AccelerationCondition": _acceleration,
    "AngleCondition": _angle,
    "EndOfRoadCondition": _end_of_road,
    "OffroadCondition": _offroad,
}
