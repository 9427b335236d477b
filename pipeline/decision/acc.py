"""Adaptive cruise control: a desired speed from the lead's distance, and pedals from a PID (paper, section ACC).

The printed Algorithm 3 applies the gap law where d ≤ d_min, where it is negative; keeps v_current indefinitely once the
lead is gone; and lets the last object of its loop win. This module implements the intended algorithm: the law applies
where d ≤ d_desired, clipped to [0, set speed]; with nothing ahead, the car returns to the set speed; the smallest
demand wins. Where the path is too uncertain to tell the lead, ACC does not accelerate."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from pipeline.decision.object_motion import closing_speed_mps, required_decel_mps2
from pipeline.decision.reaction_candidates import enters_corridor, is_dependable, is_there_now
from pipeline.params import AccParams, AebParams
from pipeline.types import AccCommand, Braking, Cipv, EgoState, FusedObject, Path, Situation

STANDSTILL_MPS = 0.1
CREEP_MPS = 3.0
"""Below this speed own motion shows no curvature, so a car that may not creep would never determine its path."""
_SLOW_MPS, _FAST_MPS = 5.0, 20.0
"""Speeds between which ISO 15622's limits are interpolated."""
State = Literal["cruise", "follow", "stop", "warn"]


@dataclass(frozen=True)
class AccState:
    """State of the PID controller."""

    integral_m: float = 0.0
    """Integral of the speed error over time."""
    error_mps: float | None = None
    """Speed error of the previous frame; None at the start."""
    accel_mps2: float = 0.0
    """Acceleration commanded in the previous frame."""
    on_course: Mapping[int, int] = field(default_factory=dict)
    """By object id, number of consecutive frames in which its course has led into the corridor."""
    lead_id: int | None = None
    """The CIPV."""
    lead_frames: int = 0
    """Number of consecutive frames in which it has been the CIPV."""


@dataclass(frozen=True)
class Demand:
    """One requested speed; the smallest wins."""

    speed_mps: float
    """The requested speed."""
    state: State
    """The state that is reported if this demand wins."""
    reason: str
    """Why, in words."""
    object_id: int | None = None
    """The object that the car slows down for."""
    no_faster: bool = False
    """Do not accelerate, even if the PID state would."""


def control(
    state: AccState, situation: Situation, params: AccParams, emergency: AebParams
) -> tuple[AccState, AccCommand | None]:
    """Pedals for this frame; None, with the state cleared, if own speed is unknown and was not known recently either.
    emergency: parameters for the required deceleration, and for what is on a collision course."""
    ego = situation.now.ego
    if ego is None:
        return AccState(), None
    threats = _on_course(situation, params, emergency)
    on_course = {item.id: state.on_course.get(item.id, 0) + 1 for item in threats}
    lead_id = situation.lead.id if situation.lead is not None else None
    lead_frames = state.lead_frames + 1 if lead_id == state.lead_id else 1
    state = replace(state, on_course=on_course, lead_id=lead_id, lead_frames=lead_frames)
    confirmed = [item for item in threats if on_course[item.id] >= params.confirm_frames]
    # Each rule requests a speed, and the smallest one wins
    demand = min(
        (
            follow(ego, situation.lead, _error_m(situation, params), params),
            *avoid(ego, confirmed, params),
            *hold(ego, situation.path, params),
        ),
        key=lambda wish: wish.speed_mps,
    )
    # A PID controller converts the speed error to an acceleration, and this to pedal positions
    hardest = _hardest_mps2(state, demand.object_id, situation, params, emergency)
    state, accel = pid(state, demand.speed_mps - ego.speed_mps, situation.now.dt_s, params, hardest)
    accel = min(accel, 0.0) if demand.no_faster else accel
    return replace(state, accel_mps2=accel), AccCommand(
        state=demand.state,
        desired_speed_mps=demand.speed_mps,
        accel_mps2=accel,
        accelerator=max(accel, 0.0) / params.max_accel_mps2,
        brake=max(-accel, 0.0) / params.max_decel_mps2,
        reason=demand.reason,
        object_id=demand.object_id,
    )


def _hardest_mps2(
    state: AccState, object_id: int | None, situation: Situation, params: AccParams, emergency: AebParams
) -> float:
    """The hardest permitted braking: comfortable in strength and onset, unless avoiding a collision takes more and the
    evidence for the object justifies it, which for a lead includes that this frame shows it in the path, and the frame
    before too: two vehicles may be one cluster for a moment. A gap that is too short but does not shrink, as after a
    cut-in, is opened gently, where the paper's law alone would brake fully. A lead of only a few frames hardly slows
    the car."""
    assert situation.now.ego is not None
    required, strongest = 0.0, params.comfort_decel_mps2  # also applies when slowing to the set speed
    if object_id is not None:
        item = situation.object(object_id)
        required = _required_mps2(object_id, item, situation, params, emergency)
        is_lead = situation.lead is not None and situation.lead.id == object_id
        is_doubtful = is_lead and (
            state.lead_frames < params.confirm_frames or (item is not None and not is_there_now(item, emergency))
        )
        if (item is None or item.justifies is Braking.FULL) and not is_doubtful:
            strongest = max(strongest, required)
    return min(strongest, max(_onset_mps2(state, situation.now.ego, situation.now.dt_s, params), required))


def _onset_mps2(state: AccState, ego: EgoState, dt_s: float | None, params: AccParams) -> float:
    """The deceleration that comfort permits ``dt_s`` after the last one. ISO 15622: it increases by at most 2.5 m/s³
    above 20 m/s and 5 m/s³ below 5 m/s, linear in between."""
    if dt_s is None or params.comfort_jerk_mps3 <= 0.0:
        return math.inf
    slowness = min(max((_FAST_MPS - ego.speed_mps) / (_FAST_MPS - _SLOW_MPS), 0.0), 1.0)
    return max(-state.accel_mps2, 0.0) + params.comfort_jerk_mps3 * (1.0 + slowness) * dt_s


def _required_mps2(
    object_id: int, item: FusedObject | None, situation: Situation, params: AccParams, emergency: AebParams
) -> float:
    """The deceleration required to avoid the object. One of unknown speed is assumed to stand still, but if it was seen
    only once, nothing is required: it may be a false box on a stray cluster, and the second sighting measures its
    speed."""
    lead, ego = situation.lead, situation.now.ego
    assert ego is not None
    distance: float | None = None
    closing: float | None = None
    if lead is not None and lead.id == object_id:
        distance, closing = lead.distance_m, lead.closing_speed_mps
    elif item is not None:
        distance, closing = item.distance_m, closing_speed_mps(item)
    if closing is None and item is not None and item.hits < params.speed_hits:
        return 0.0
    if distance is None:
        return math.inf
    return required_decel_mps2(distance, ego.speed_mps if closing is None else closing, emergency)


def _error_m(situation: Situation, params: AccParams) -> float:
    """By how much the lead may be farther away than estimated."""
    lead = situation.object(situation.lead.id) if situation.lead is not None else None
    return params.gap_sigmas * ((lead.distance_sigma_m if lead is not None else None) or 0.0)


def cruise(params: AccParams) -> Demand:
    """The set speed."""
    return Demand(params.set_speed_kmh / 3.6, "cruise", "nothing to slow down for")


def desired_gap_m(speed_mps: float, params: AccParams) -> float:
    """d_desired: a time gap on top of the gap at standstill."""
    return params.min_gap_m + params.time_gap_s * speed_mps


def follow(ego: EgoState, cipv: Cipv | None, error_m: float, params: AccParams) -> Demand:
    """v_desired = v_current · (d − d_min) / (d_desired − d_min) (paper, Eq. acc), clipped to [0, set speed]. Beyond
    d_desired, where the law is not defined, the set speed.

    error_m: by how much the lead may be farther away than estimated. A gap is a matter of comfort, and at 50 m a
    camera's distance is wrong by 10 m now and then (a van that it takes for a car), so the car slows down only for a
    gap that is too short beyond this error. Approaching a slower vehicle is no matter of comfort, and uses the distance
    as it is: with the error, a car standing on a motorway would be hit at 15 to 30 km/h.
    """
    set_speed = params.set_speed_kmh / 3.6
    if cipv is None:
        return cruise(params)
    wanted = desired_gap_m(ego.speed_mps, params)
    if cipv.distance_m <= params.min_gap_m:
        return Demand(0.0, "stop", f"lead #{cipv.id} within the minimum gap of {params.min_gap_m:.1f} m", cipv.id)
    gap_m = cipv.distance_m + error_m
    if gap_m > wanted:
        safe = _approach_speed_mps(ego, cipv, params)
        if safe < min(ego.speed_mps, set_speed):
            return Demand(safe, "follow", f"closing in on lead #{cipv.id} too fast", cipv.id)
        if cipv.distance_m > wanted:
            return Demand(set_speed, "cruise", f"lead #{cipv.id} beyond the desired gap of {wanted:.1f} m")
        within = f"lead #{cipv.id} at the desired gap of {wanted:.1f} m within ±{error_m:.1f} m"
        speed = min(ego.speed_mps, set_speed)
        return Demand(speed, "follow", f"{within}: ACC will not accelerate", cipv.id, no_faster=True)
    speed = ego.speed_mps * (gap_m - params.min_gap_m) / (wanted - params.min_gap_m)
    return Demand(min(speed, set_speed), "follow", f"lead #{cipv.id} within the desired gap of {wanted:.1f} m", cipv.id)


def _approach_speed_mps(ego: EgoState, cipv: Cipv, params: AccParams) -> float:
    """The speed from which braking by ``approach_decel_mps2`` still ends at the lead's speed and the gap desired there.
    The paper's law starts at the desired gap, which is too late for a slow lead: from 100 km/h it would take 9 m/s²."""
    if params.approach_decel_mps2 <= 0.0 or cipv.closing_speed_mps is None:
        return math.inf
    lead_mps = max(ego.speed_mps - cipv.closing_speed_mps, 0.0)
    spare_m = max(cipv.distance_m - desired_gap_m(lead_mps, params), 0.0)
    return lead_mps + math.sqrt(2.0 * params.approach_decel_mps2 * spare_m)


def avoid(ego: EgoState, threats: Iterable[FusedObject], params: AccParams) -> list[Demand]:
    """Slow down for objects other than the CIPV while their TTC is below the limit (paper, Algorithm 3; where it says
    "slow down until TTC goes below", it means above)."""
    return [
        Demand(
            ego.speed_mps * (item.ttc_s or 0.0) / params.ttc_limit_s,
            "warn",
            f"would hit #{item.id} in {item.ttc_s:.1f} s",
            item.id,
        )
        for item in threats
    ]


def _on_course(situation: Situation, params: AccParams, emergency: AebParams) -> list[FusedObject]:
    """The objects other than the CIPV that would be hit before the TTC limit. Only objects whose course leads into the
    corridor by then: an oncoming car in its own lane also has a short TTC, but passes."""
    return [
        item
        for item in situation.objects
        if (situation.lead is None or item.id != situation.lead.id)
        and item.ttc_s is not None
        and item.ttc_s < params.ttc_limit_s
        and (closing_speed_mps(item) or 0.0) > STANDSTILL_MPS
        and is_dependable(item)
        and enters_corridor(item, situation.path, situation.lead, emergency)
    ]


def hold(ego: EgoState, path: Path, params: AccParams) -> list[Demand]:
    """Do not accelerate while the path is not usable, because a lead could be anywhere, or while own speed is not
    measured. On an unusable path the car may still creep, at speeds where own motion cannot show a curve."""
    coasts = ego.coasting is not None
    if path.usable and not coasts:
        return []
    allowed = ego.speed_mps if coasts else max(ego.speed_mps, CREEP_MPS)
    if allowed >= params.set_speed_kmh / 3.6:
        return []
    why = f"ego speed not measured for {ego.coasting.age_s:.1f} s" if ego.coasting is not None else path.doubt
    holds = allowed <= ego.speed_mps
    limit = "ACC will not accelerate" if holds else f"ACC will not exceed {allowed * 3.6:.0f} km/h"
    return [Demand(allowed, "cruise", f"{why}: {limit}", no_faster=holds)]


def pid(
    state: AccState, error_mps: float, dt_s: float | None, params: AccParams, hardest_mps2: float = math.inf
) -> tuple[AccState, float]:
    """Acceleration in m/s² from a speed error, no lower than -hardest_mps2, with anti-windup: while the output is
    clipped, the integral only unwinds. Without dt (first frame) only the proportional part acts."""
    slope = (error_mps - state.error_mps) / dt_s if dt_s and state.error_mps is not None else 0.0
    integral = state.integral_m + (error_mps * dt_s if dt_s else 0.0)
    wanted = params.kp * error_mps + params.ki * integral + params.kd * slope
    accel = min(max(wanted, -min(hardest_mps2, params.brake_limit_mps2, params.max_decel_mps2)), params.max_accel_mps2)
    winds_up = (wanted != accel) and (error_mps > 0) == (wanted > 0)
    return replace(state, integral_m=state.integral_m if winds_up else integral, error_mps=error_mps), accel
