"""Actions: what the storyboard makes entities do, and what of it is left out or refused."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, sqrt

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.storyboard.controllers import note_controller
from pipeline.simulation.openscenario.storyboard.movers import SHAPES, Mover, seconds_for
from pipeline.simulation.openscenario.storyboard.positions import lane_at, lane_beside, place_at
from pipeline.simulation.openscenario.storyboard.routing import check_route, follow_trajectory
from pipeline.simulation.openscenario.storyboard.running import OffsetChange, Running
from pipeline.simulation.openscenario.storyboard.speeds import (
    longitudinal_distance,
    speed_action,
    speed_profile,
    synchronize,
)
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.xml_files import XmlElement, number_in, shown

_LIGHT = "Weather, light and friction of the scenario are left out: the simulator has one sky and a dry road."
_SIGNALS = "Traffic signals of the scenario are left out."
_APPEARANCE = "Appearance (lights, animation) of the scenario is left out."
_LEFT_OUT = {"EnvironmentAction": _LIGHT, "InfrastructureAction": _SIGNALS}
_AT_ONCE_S = 0.5
"""Entities that are deleted later than this would be missed."""
_QUINTIC_PEAK = 10.0 / sqrt(3.0)
"""Highest lateral acceleration of the simulator's lane change, times duration² / width."""
_SUPPORTED = (
    "SpeedAction, SpeedProfileAction, LongitudinalDistanceAction, SynchronizeAction, LaneChangeAction, "
    "LaneOffsetAction, AssignRouteAction, AcquirePositionAction, FollowTrajectoryAction, VariableAction, "
    "ParameterAction and, at the start, TeleportAction and DeleteEntityAction are"
)


def start_action(at: XmlElement, actors: list[str], scope: ParameterScope, stage: PlayedScenario) -> list[Running]:
    """Start a ``PrivateAction`` or ``GlobalAction`` for all actors. OpenScenarioError if the simulator cannot play
    it."""
    if at.tag == "GlobalAction":
        _global(at.only(), scope, stage)
        return []
    if at.tag != "PrivateAction":
        raise at.refusal(f"{shown(at.tag)} is not supported; {_SUPPORTED}")
    if not actors:
        raise at.refusal("this action has no actors")
    running = [_private(at.only(), name, scope, stage) for name in actors]
    return [each for each in running if each is not None]


def _global(at: XmlElement, scope: ParameterScope, stage: PlayedScenario) -> None:
    if at.tag in _LEFT_OUT:
        stage.note(_LEFT_OUT[at.tag])
        return
    if at.tag == "EntityAction":
        _delete(at, scope, stage)
    elif at.tag == "ParameterAction":
        name = scope.text(at, "parameterRef")
        if name not in scope.values:
            raise at.refusal(f"no parameter {shown(name)!r} is declared")
        stage.assigned[name] = _changed(stage.assigned.get(name, scope.values[name]), name, at.only(), scope)
    elif at.tag == "VariableAction":
        name = scope.text(at, "variableRef")
        if name not in stage.variables:
            raise at.refusal(f"no variable {shown(name)!r} is declared")
        stage.variables[name] = _changed(stage.variables[name], name, at.only(), scope)
    else:
        raise at.refusal(f"{shown(at.tag)} is not supported; {_SUPPORTED}")


def _changed(before: str, name: str, how: XmlElement, scope: ParameterScope) -> str:
    """The value of a variable or parameter after a ``SetAction`` or ``ModifyAction``."""
    if how.tag == "SetAction":
        return scope.text(how, "value")
    rule = how.one("Rule").only()
    value, number = scope.number(rule, "value"), number_in(before, how, name)
    return repr(number + value if rule.tag in ("AddValue", "addValue") else number * value)


def _delete(at: XmlElement, scope: ParameterScope, stage: PlayedScenario) -> None:
    """An entity that is deleted as the drive begins is left out."""
    name, how = scope.text(at, "entityRef"), at.only()
    if how.tag != "DeleteEntityAction" or name == stage.ego:
        raise how.refusal(f"{shown(how.tag)} for {shown(name)} is not supported; DeleteEntityAction for others is")
    if stage.t_s > _AT_ONCE_S:
        raise how.refusal(f"DeleteEntityAction is supported at the start only: {shown(name)} cannot vanish later")
    if stage.movers.pop(name, None) is not None:
        stage.left_out.add(name)
        stage.note(f"{shown(name)} is left out: the file deletes it as the drive begins.")


def _private(at: XmlElement, name: str, scope: ParameterScope, stage: PlayedScenario) -> Running | None:
    if name in stage.left_out:
        return None
    if at.tag == "AppearanceAction":
        stage.note(_APPEARANCE)
        return None
    if at.tag in ("ControllerAction", "ActivateControllerAction"):
        note_controller(at, name, scope, stage)
        return None
    mover = stage.mover(name, at)
    if at.tag == "TeleportAction":
        _at_start(at, stage)
        mover.place(place_at(at.one("Position"), scope, mover.road, stage))
        return None
    inner = at.only() if at.tag in ("LongitudinalAction", "LateralAction", "RoutingAction") else at
    starter = _STARTERS.get(inner.tag)
    if starter is None:
        raise inner.refusal(f"{shown(inner.tag)} is not supported; {_SUPPORTED}")
    return starter(inner, mover, scope, stage)


def _at_start(at: XmlElement, stage: PlayedScenario) -> None:
    if stage.t_s > 0.0:
        raise at.refusal(f"{at.tag} is supported at the start only: nothing can jump during a drive")


def _lane_change(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> Running:
    """A relative target counts lanes to the left of the other entity, as that entity faces."""
    target, dynamics = at.one("LaneChangeTarget").only(), at.one("LaneChangeActionDynamics")
    here = mover.place_now(stage.t_s)
    if target.tag == "AbsoluteTargetLane":
        lane = scope.integer(target, "value")
    else:
        other = stage.place_of(scope.text(target, "entityRef"), target, mover.road)
        count = scope.integer(target, "value") * other.way * mover.road.track_at(other.s_m).way
        lane = lane_beside(mover.road, other, count, target)
    d_m = mover.road.lane_or_refusal(here.s_m, lane, target)
    d_m += mover.road.hand * mover.way * scope.number(at, "targetLaneOffset", 0.0)
    now = mover.now(stage.t_s)[1]
    shape = scope.text(dynamics, "dynamicsShape")
    if shape == "step":
        raise dynamics.refusal("a lane change by a step is not supported: nothing can jump during a drive")
    duration_s = seconds_for(
        shape,
        scope.text(dynamics, "dynamicsDimension"),
        scope.number(dynamics, "value"),
        d_m - now.d_m,
        now.speed_mps,
        dynamics,
    )
    ends_s = mover.change_lane(stage.t_s, d_m, duration_s, at) if duration_s > 0.0 else stage.t_s
    return OffsetChange(mover, ends_s, mover.lane_version)


def _lane_offset(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> Running:
    """Its duration follows from the highest lateral acceleration, which the file must give."""
    target, dynamics = at.one("LaneOffsetTarget").only(), at.one("LaneOffsetActionDynamics")
    limit = scope.number(dynamics, "maxLateralAcc", 0.0)
    if limit <= 0.0 or scope.text(dynamics, "dynamicsShape") not in SHAPES[:-1]:
        raise dynamics.refusal(f"LaneOffsetAction needs a maxLateralAcc and one of {', '.join(SHAPES[:-1])}")
    offset = mover.road.hand * mover.way * scope.number(target, "value")
    here, now = mover.place_now(stage.t_s), mover.now(stage.t_s)[1]
    if target.tag == "AbsoluteTargetLaneOffset":
        d_m = mover.road.lanes_at(here.s_m)[lane_at(mover.road, here)] + offset
    else:
        d_m = stage.place_of(scope.text(target, "entityRef"), target, mover.road).d_m + offset
    ends_s = stage.t_s
    if d_m != now.d_m:
        ends_s = mover.change_lane(stage.t_s, d_m, sqrt(_QUINTIC_PEAK * abs(d_m - now.d_m) / limit), at)
    if scope.truth(at, "continuous", False):
        if target.tag != "AbsoluteTargetLaneOffset":
            other = stage.mover(scope.text(target, "entityRef"), target)
            stage.watch_offset(other, at)
        return OffsetChange(mover, inf, mover.lane_version)
    return OffsetChange(mover, ends_s, mover.lane_version)


_STARTERS: dict[str, Callable[[XmlElement, Mover, ParameterScope, PlayedScenario], Running | None]] = {
    "SpeedAction": speed_action,
    "SpeedProfileAction": speed_profile,
    "LongitudinalDistanceAction": longitudinal_distance,
    "SynchronizeAction": synchronize,
    "LaneChangeAction": _lane_change,
    "LaneOffsetAction": _lane_offset,
    "AssignRouteAction": check_route,
    "AcquirePositionAction": check_route,
    "FollowTrajectoryAction": follow_trajectory,
}
