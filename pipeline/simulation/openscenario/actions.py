"""Actions: what the storyboard makes entities do, and what of it is left out or refused."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from pipeline.simulation.openscenario.movers import SHAPES, Mover, seconds_for
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.positions import RoadPlace, lane_at, lane_beside, middle_of, place_at
from pipeline.simulation.openscenario.stage import PlayedScenario
from pipeline.simulation.openscenario.xml_files import XmlElement, number_in, shown

_LIGHT = "Weather, light and friction of the scenario are left out: the simulator has one sky and a dry road."
_APPEARANCE = "Appearance (lights, animation) of the scenario is left out."
_CONTROLLER = "The ego vehicle's controller is left out: it follows its actions in the storyboard, or our controller."
_QUINTIC_PEAK = 10.0 / sqrt(3.0)
"""Highest lateral acceleration of the simulator's lane change, times duration² / width."""
_SUPPORTED = (
    "SpeedAction, LaneChangeAction, LaneOffsetAction, VariableAction and, at the start, TeleportAction and "
    "LongitudinalDistanceAction are"
)


@dataclass(frozen=True)
class RunningAction:
    """An action of one entity that takes time."""

    mover: Mover
    """Whom it moves."""
    is_speed: bool
    """Whether it changes the speed, otherwise the offset."""
    ends_s: float
    """When it is complete."""
    version: int
    """``Mover.speed_version`` since it began: a later action on the speed ends it."""

    def is_over(self, t_s: float) -> bool:
        """Whether it is complete, or another took its place."""
        return t_s >= self.ends_s - 1e-9 or (self.is_speed and self.mover.speed_version != self.version)

    def stop(self, t_s: float, at: XmlElement) -> None:
        """End it before it is complete: the speed that was reached is held."""
        if self.is_over(t_s):
            return
        if not self.is_speed:
            raise at.refusal(f"an event interrupts a lane change of {shown(self.mover.body.name)}; not supported")
        self.mover.change_speed(t_s, self.mover.now(t_s)[1].speed_mps, "step", 0.0, at)


def start_action(
    at: XmlElement, actors: list[str], scope: ParameterScope, stage: PlayedScenario
) -> list[RunningAction]:
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
    if at.tag == "EnvironmentAction":
        stage.note(_LIGHT)
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


def _private(at: XmlElement, name: str, scope: ParameterScope, stage: PlayedScenario) -> RunningAction | None:
    if at.tag == "AppearanceAction":
        stage.note(_APPEARANCE)
        return None
    if at.tag in ("ControllerAction", "ActivateControllerAction") and name == stage.ego:
        stage.note(_CONTROLLER)
        return None
    mover = stage.mover(name, at)
    if at.tag == "TeleportAction":
        _at_start(at, stage)
        mover.place(place_at(at.one("Position"), scope, stage.road, stage.place_of))
        return None
    inner = at.only() if at.tag in ("LongitudinalAction", "LateralAction") else at
    if inner.tag == "LongitudinalDistanceAction":
        mover.place(_at_distance(inner, mover, scope, stage))
        return None
    starter = {
        "SpeedAction": _speed,
        "LaneChangeAction": _lane_change,
        "LaneOffsetAction": _lane_offset,
    }.get(inner.tag)
    if starter is None:
        what = inner.children[0].tag if inner.tag in ("RoutingAction", "ControllerAction") and inner.children else ""
        raise inner.refusal(f"{shown(what or inner.tag)} is not supported; {_SUPPORTED}")
    ends_s = starter(inner, mover, scope, stage)
    return RunningAction(mover, inner.tag == "SpeedAction", ends_s, mover.speed_version)


def _at_start(at: XmlElement, stage: PlayedScenario) -> None:
    if stage.t_s > 0.0:
        raise at.refusal(f"{at.tag} is supported at the start only: nothing can jump during a drive")


def _at_distance(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> RoadPlace:
    """The place that has the demanded distance from another entity, in its lane's direction."""
    _at_start(at, stage)
    if scope.truth(at, "continuous", False) or at.find("DynamicConstraints") is not None:
        raise at.refusal("LongitudinalDistanceAction is supported as a jump only: neither continuous nor constrained")
    if "distance" not in at.attributes:
        raise at.refusal("LongitudinalDistanceAction needs a distance")
    gap_m, other = scope.number(at, "distance"), stage.mover(scope.text(at, "entityRef"), at)
    displacement = scope.text(at, "displacement", "any")
    here, there = mover.place_now(0.0), other.place_now(0.0)
    sign = {"leadingReferencedEntity": there.way, "trailingReferencedEntity": -there.way}.get(
        displacement, 1 if here.s_m >= there.s_m else -1
    )
    if scope.truth(at, "freespace", True):
        centre = other.now(0.0)[0] + sign * (gap_m + (mover.body.size_m[0] + other.body.size_m[0]) / 2)
        return here._replace(s_m=centre - mover.way * mover.body.centre_m)
    return here._replace(s_m=there.s_m + sign * gap_m)


def _speed(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> float:
    target, dynamics = at.one("SpeedActionTarget").only(), at.one("SpeedActionDynamics")
    to_mps = scope.number(target, "value")
    if target.tag == "RelativeTargetSpeed":
        if scope.truth(target, "continuous", False):
            raise target.refusal("RelativeTargetSpeed with continuous=true is not supported")
        other_mps = stage.speed(scope.text(target, "entityRef"), target)
        is_factor = scope.text(target, "speedTargetValueType", "delta") == "factor"
        to_mps = other_mps * to_mps if is_factor else other_mps + to_mps
    now_mps = mover.now(stage.t_s)[1].speed_mps
    shape = scope.text(dynamics, "dynamicsShape")
    duration_s = seconds_for(
        shape,
        scope.text(dynamics, "dynamicsDimension", "time"),
        scope.number(dynamics, "value", 0.0),
        to_mps - now_mps,
        (now_mps + to_mps) / 2,
        dynamics,
    )
    return mover.change_speed(stage.t_s, to_mps, shape, duration_s, at)


def _lane_change(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> float:
    """A relative target counts lanes to the left of the other entity, as that entity faces."""
    target, dynamics = at.one("LaneChangeTarget").only(), at.one("LaneChangeActionDynamics")
    if target.tag == "AbsoluteTargetLane":
        d_m = middle_of(stage.road, scope.integer(target, "value"), target)
    else:
        other = stage.place_of(scope.text(target, "entityRef"), target)
        count = scope.integer(target, "value") * other.way
        d_m = stage.road.lanes[lane_beside(stage.road, lane_at(stage.road, other.d_m), count, target)]
    d_m += mover.way * scope.number(at, "targetLaneOffset", 0.0)
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
    return mover.change_lane(stage.t_s, d_m, duration_s, at) if duration_s > 0.0 else stage.t_s


def _lane_offset(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> float:
    """Its duration follows from the highest lateral acceleration, which the file must give."""
    target, dynamics = at.one("LaneOffsetTarget").only(), at.one("LaneOffsetActionDynamics")
    if scope.truth(at, "continuous", False):
        raise at.refusal("LaneOffsetAction with continuous=true is not supported")
    limit = scope.number(dynamics, "maxLateralAcc", 0.0)
    if limit <= 0.0 or scope.text(dynamics, "dynamicsShape") not in SHAPES[:-1]:
        raise dynamics.refusal(f"LaneOffsetAction needs a maxLateralAcc and one of {', '.join(SHAPES[:-1])}")
    offset, now = mover.way * scope.number(target, "value"), mover.now(stage.t_s)[1]
    if target.tag == "AbsoluteTargetLaneOffset":
        d_m = stage.road.lanes[lane_at(stage.road, now.d_m)] + offset
    else:
        d_m = stage.place_of(scope.text(target, "entityRef"), target).d_m + offset
    if d_m == now.d_m:
        return stage.t_s
    return mover.change_lane(stage.t_s, d_m, sqrt(_QUINTIC_PEAK * abs(d_m - now.d_m) / limit), at)
