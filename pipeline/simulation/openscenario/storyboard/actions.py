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
_QUINTIC_PEAK = 10.0 / sqrt(3.0)
"""Highest lateral acceleration of the simulator's lane change, times duration² / width."""
_SUPPORTED = (
    "SpeedAction, SpeedProfileAction, LongitudinalDistanceAction, SynchronizeAction, LaneChangeAction, "
    "LaneOffsetAction, AssignRouteAction, AcquirePositionAction, FollowTrajectoryAction, VariableAction and, at the "
    "start, TeleportAction are"
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
    if at.tag != "VariableAction":
        raise at.refusal(f"{shown(at.tag)} is not supported; {_SUPPORTED}")
    name, how = scope.text(at, "variableRef"), at.only()
    if name not in stage.variables:
        raise at.refusal(f"no variable {shown(name)!r} is declared")
    if how.tag == "SetAction":
        stage.variables[name] = scope.text(how, "value")
        return
    rule = how.one("Rule").only()
    value, before = scope.number(rule, "value"), number_in(stage.variables[name], at, name)
    stage.variables[name] = repr(before + value if rule.tag == "AddValue" else before * value)


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
        mover.place(place_at(at.one("Position"), scope, stage.road, stage.place_of))
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
        other = stage.place_of(scope.text(target, "entityRef"), target)
        count = scope.integer(target, "value") * other.way * stage.road.track_at(other.s_m).way
        lane = lane_beside(stage.road, other, count, target)
    d_m = stage.road.lane_or_refusal(here.s_m, lane, target)
    d_m += stage.road.hand * mover.way * scope.number(at, "targetLaneOffset", 0.0)
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
    offset = stage.road.hand * mover.way * scope.number(target, "value")
    here, now = mover.place_now(stage.t_s), mover.now(stage.t_s)[1]
    if target.tag == "AbsoluteTargetLaneOffset":
        d_m = stage.road.lanes_at(here.s_m)[lane_at(stage.road, here)] + offset
    else:
        d_m = stage.place_of(scope.text(target, "entityRef"), target).d_m + offset
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
