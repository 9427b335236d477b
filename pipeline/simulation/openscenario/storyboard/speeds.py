"""Actions on the speed of an entity."""

from __future__ import annotations

from contextlib import suppress
from math import inf, sqrt

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.roads.driven_road import OffTheWay
from pipeline.simulation.openscenario.storyboard.movers import Mover, seconds_for, share_of
from pipeline.simulation.openscenario.storyboard.positions import place_at
from pipeline.simulation.openscenario.storyboard.running import (
    Arrive,
    KeepDistance,
    Limits,
    RelativeSpeed,
    Running,
    SpeedChange,
    SpeedControl,
    SpeedLaw,
)
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.xml_files import XmlElement, shown

_SIDES = {"leadingReferencedEntity": 1, "trailingReferencedEntity": -1}
_RAMP_PIECES = 10
"""Linear pieces of each end of a change of speed with limited jerk: within 0.3 % of the change."""


def speed_action(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> Running:
    """``SpeedAction``: once, or kept relative to another entity."""
    target, dynamics = at.one("SpeedActionTarget").only(), at.one("SpeedActionDynamics")
    value, is_factor = scope.number(target, "value"), False
    to_mps, other = value, None
    if target.tag == "RelativeTargetSpeed":
        other = stage.mover(scope.text(target, "entityRef"), target)
        is_factor = scope.text(target, "speedTargetValueType", "delta") == "factor"
        other_mps = other.now(stage.t_s)[1].speed_mps
        to_mps = other_mps * value if is_factor else other_mps + value
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
    if other is None or not scope.truth(target, "continuous", False):
        ends_s = mover.change_speed(stage.t_s, to_mps, shape, duration_s, at)
        return SpeedChange(mover, ends_s, mover.speed_version)
    if duration_s == 0.0:
        mover.change_speed(stage.t_s, to_mps, "step", 0.0, at)
        now_mps = to_mps

    def share(done: float) -> float:
        return share_of(shape, done)

    law = RelativeSpeed(other, value, is_factor, now_mps, stage.t_s, duration_s, share)
    return _controlled(at, mover, law, stage)


def speed_profile(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> Running:
    """``SpeedProfileAction``: each entry is reached after its time, or as fast as the limits allow. In the mode
    *follow* the limits prolong changes that are too fast; in the mode *position* the times count."""
    limits, follows = _limits(at, scope), scope.text(at, "followingMode", "position") == "follow"
    base_mps = 0.0
    if "entityRef" in at.attributes:
        base_mps = stage.speed(scope.text(at, "entityRef"), at)
    time_s, speed = stage.t_s, mover.now(stage.t_s)[1].speed_mps
    corners = [(time_s, speed)]
    for entry in at.all("SpeedProfileEntry"):
        to_mps = min(base_mps + scope.number(entry, "speed"), limits.speed_mps)
        given_s = scope.number(entry, "time") if "time" in entry.attributes else None
        if given_s is not None and given_s < 0.0:
            raise entry.refusal("a negative time")
        if given_s is None and limits.accel_mps2 == inf:
            raise entry.refusal("SpeedProfileEntry needs a time, or DynamicConstraints with accelerations")
        change = _ramp(speed, to_mps, given_s, limits if follows or given_s is None else Limits())
        corners += [(time_s + after_s, mps) for after_s, mps in change]
        time_s, speed = corners[-1]
    steps = [corner for i, corner in enumerate(corners) if i == 0 or corner[0] > corners[i - 1][0]]
    return SpeedChange(mover, mover.plan_speed(steps, at, time_s), mover.speed_version)


def _ramp(from_mps: float, to_mps: float, time_s: float | None, limits: Limits) -> list[tuple[float, float]]:
    """(seconds, m/s) of a change of speed: linear, or with the acceleration rising and falling at the limits' rates.
    With the acceleration a, rates j₁ and j₂, a change Δv takes Δv / a + a (1/j₁ + 1/j₂) / 2."""
    change = abs(to_mps - from_mps)
    if change == 0.0:
        return [(time_s or 0.0, to_mps)]
    faster = to_mps > from_mps
    most = limits.accel_mps2 if faster else limits.decel_mps2
    up, down = limits.accel_rate_mps3, limits.decel_rate_mps3
    rise, fall = (1 / up, 1 / down) if faster else (1 / down, 1 / up)
    ends = rise + fall
    peak = min(most, sqrt(2.0 * change / ends) if ends else most)
    shortest_s = change / peak + peak * ends / 2.0 if peak < inf else 0.0
    if time_s is None or time_s < shortest_s:
        time_s, accel = shortest_s, peak
    elif ends:
        accel = (time_s - sqrt(max(time_s**2 - 2.0 * change * ends, 0.0))) / ends
    else:
        accel = change / time_s if time_s > 0.0 else inf
    if not ends or time_s == 0.0:
        return [(time_s, to_mps)]
    sign, middle_s = (1.0 if faster else -1.0), time_s - accel * ends
    found = [(p * accel * rise, sign * p * p * accel**2 * rise / 2.0) for p in _shares()]
    found.append((accel * rise + middle_s, found[-1][1] + sign * accel * middle_s))
    start_s, start = found[-1]
    found += [(start_s + p * accel * fall, start + sign * accel**2 * fall * (p - p * p / 2.0)) for p in _shares()]
    return [*((after, from_mps + gained) for after, gained in found[:-1]), (time_s, to_mps)]


def _shares() -> list[float]:
    return [(i + 1) / _RAMP_PIECES for i in range(_RAMP_PIECES)]


def longitudinal_distance(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> Running | None:
    """``LongitudinalDistanceAction``: a jump at the start if nothing limits it, otherwise driven."""
    other = stage.mover(scope.text(at, "entityRef"), at)
    if mover.line is not None:
        raise at.refusal(f"{at.tag} of {shown(mover.body.name)} is not supported: it follows no lane")
    if ("distance" in at.attributes) == ("timeGap" in at.attributes):
        raise at.refusal("LongitudinalDistanceAction needs either a distance or a timeGap")
    distance_m = scope.number(at, "distance") if "distance" in at.attributes else None
    time_gap_s = scope.number(at, "timeGap", 0.0)
    side = _side(scope.text(at, "displacement", "any"), mover, other, stage)
    extra_m = 0.0
    if scope.truth(at, "freespace", True):
        extra_m = side * (mover.body.size_m[0] + other.body.size_m[0]) / 2
        extra_m += other.place_on(mover.road, stage.t_s).way * other.body.centre_m - mover.way * mover.body.centre_m
    is_continuous, is_limited = scope.truth(at, "continuous", False), at.find("DynamicConstraints") is not None
    if not is_limited:
        if stage.t_s > 0.0:
            raise at.refusal(
                "LongitudinalDistanceAction without DynamicConstraints is supported at the start only: nothing can "
                "jump during a drive"
            )
        gap_m = time_gap_s * mover.now(0.0)[1].speed_mps if distance_m is None else distance_m
        there = other.place_on(mover.road, 0.0)
        mover.place(mover.place_now(0.0)._replace(s_m=there.s_m + side * gap_m + extra_m))
        if not is_continuous:
            return None
    law = KeepDistance(other, side, distance_m, time_gap_s, extra_m, _limits(at, scope), is_continuous)
    return _controlled(at, mover, law, stage)


def _side(displacement: str, mover: Mover, other: Mover, stage: PlayedScenario) -> int:
    """Whether to be ahead (+1) or behind (−1) along the way."""
    own, there = mover.place_now(stage.t_s), other.place_on(mover.road, stage.t_s)
    if displacement in _SIDES:
        return _SIDES[displacement] * there.way
    return 1 if own.s_m >= there.s_m else -1


def synchronize(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> Running:
    """``SynchronizeAction``: two entities reach their own places at the same time."""
    other = stage.mover(scope.text(at, "masterEntityRef"), at)
    final_mps, steady_s = _final_speed(at, other, scope, stage)
    to_m = _reached_m(at.one("TargetPositionMaster"), other, scope, stage)
    own_to_m = _reached_m(at.one("TargetPosition"), mover, scope, stage)
    tolerance_m = scope.number(at, "targetTolerance", 0.0)
    return _controlled(at, mover, Arrive(other, to_m, own_to_m, final_mps, steady_s, tolerance_m), stage)


def _reached_m(position: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> float:
    """s of a position on the road or line that an entity follows; the nearest place if it lies beside that."""
    if mover.line is None:
        with suppress(OffTheWay):
            return place_at(position, scope, mover.road, stage, on_road=False).s_m
    x, y, _ = stage.pose_at(position, scope)
    return mover.line.project(x, y) if mover.line is not None else mover.road.project(x, y)[0]


def _final_speed(
    at: XmlElement, other: Mover, scope: ParameterScope, stage: PlayedScenario
) -> tuple[float | None, float]:
    """The speed at the target, if one is given, and for how many seconds before it is held."""
    final = at.find("FinalSpeed")
    if final is None:
        return None, 0.0
    speed = final.only()
    final_mps = scope.number(speed, "value")
    if speed.tag == "RelativeSpeedToMaster":
        final_mps += other.now(stage.t_s)[1].speed_mps
    if not speed.children:
        return final_mps, 0.0
    steady = speed.only()
    if steady.tag == "TargetTimeSteadyState":
        return final_mps, scope.number(steady, "time")
    if steady.tag != "TargetDistanceSteadyState" or final_mps <= 0.0:
        raise steady.refusal(f"{shown(steady.tag)} with a final speed of {final_mps:g} m/s is not supported")
    return final_mps, scope.number(steady, "distance") / final_mps


def _controlled(at: XmlElement, mover: Mover, law: SpeedLaw, stage: PlayedScenario) -> SpeedControl:
    mover.begin_control(stage.t_s)
    control = SpeedControl(mover, law, at, mover.speed_version)
    stage.controls.append(control)
    return control


def _limits(at: XmlElement, scope: ParameterScope) -> Limits:
    found = at.find("DynamicConstraints")
    if found is None:
        return Limits()
    names = ("maxAcceleration", "maxDeceleration", "maxAccelerationRate", "maxDecelerationRate", "maxSpeed")
    values = [scope.number(found, name) if name in found.attributes else inf for name in names]
    for name, value in zip(names, values, strict=True):
        if value <= 0.0:
            raise found.refusal(f"DynamicConstraints {shown(name)}={value:g}: expected a positive number")
    return Limits(*values)
