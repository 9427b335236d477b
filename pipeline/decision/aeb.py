"""Autonomous emergency braking beside ACC: warning, partial braking, full braking.

The paper brakes with its cruise control alone, whose speed law knows the distance but neither how fast the gap closes
nor what braking is still possible. Here two numbers decide for each vehicle in the path: the time to collision (TTC),
and the deceleration required to avoid it, brake build-up included. A stage starts when either passes its limit, and
lasts until the danger is over. Terms as in UN Regulation 152 and Euro NCAP's AEB car-to-car protocol.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal, NamedTuple

from pipeline.common.fast_replace import evolve
from pipeline.decision.acc import STANDSTILL_MPS
from pipeline.decision.braking_evidence import FRICTION_MPS2, has_known_height
from pipeline.decision.object_motion import closing_speed_mps, required_decel_mps2
from pipeline.decision.reaction_candidates import enters_corridor, is_dependable, is_there_now
from pipeline.params import AccParams, AebParams
from pipeline.types import AccCommand, Braking, EgoState, FusedObject, Situation

Stage = Literal["warn", "partial_brake", "full_brake"]
STAGES: tuple[Stage, ...] = ("warn", "partial_brake", "full_brake")
_NONE, _WARN, _PARTIAL, _FULL = range(4)
_SAME_PLACE_M = 2.0
"""Another object up to this much farther than the one braked for may be the same vehicle under a new id: half a car's
length, as when the nearest return is that of its mirror and then that of its rear."""


@dataclass(frozen=True)
class AebState:
    """State from one frame to the next."""

    level: int = _NONE
    """The active stage: 0 none, 1 warning, 2 partial braking, 3 full braking."""
    streak: tuple[int, ...] = (0, 0, 0)
    """For each of the three stages, the number of consecutive frames that requested it."""
    calm_s: float = 0.0
    """How long no threat has been present while a braking stage was active."""
    cause: str = ""
    """Why the stage is active, in words."""
    object_id: int | None = None
    """The object that activated it."""
    distance_m: float = 0.0
    """How far ahead that object is, or would be if it had gone on as when it was last a threat."""
    closing_mps: float = 0.0
    """Its closing speed then."""


class Threat(NamedTuple):
    """An object on a collision course."""

    id: int
    """Of the object."""
    distance_m: float
    """How far ahead it is."""
    sigma_m: float
    """Standard deviation of the distance."""
    closing_mps: float
    """How fast the gap to it shrinks."""
    ttc_s: float
    """Time to collision."""
    required_mps2: float
    """Deceleration that is surely required to avoid it; infinite if no distance is left."""
    justified: Braking
    """The hardest braking that the evidence for it justifies."""


def guard(
    state: AebState,
    command: AccCommand | None,
    situation: Situation,
    params: AebParams,
    pedals: AccParams,
) -> tuple[AebState, AccCommand | None]:
    """ACC's command, or that of the active stage if it brakes harder. A warning leaves the pedals to ACC. Without own
    speed the required braking cannot be computed: no command, and no stage."""
    ego = situation.now.ego
    if ego is None or command is None or not params.enabled:
        return AebState(), command
    # The threat that requires the hardest braking determines the stage, which is held until the danger has passed
    threats = find_threats(situation, params)
    worst = max(threats, key=lambda threat: (_level(threat, params), threat.required_mps2), default=None)
    dt_s = situation.now.dt_s or 0.0
    state = _next(_tracked(state, threats, dt_s), threats, worst, ego, dt_s, params)
    return state, _stronger(command, state, params, pedals)


def find_threats(situation: Situation, params: AebParams) -> tuple[Threat, ...]:
    """The CIPV, and any other reliable object that heads into the corridor, while the gap to them shrinks. A CIPV that
    is oncoming, or that this frame shows beside the path, counts only if it would do so as another object: in a bend
    that was not foreseen, oncoming traffic is in the path for a moment before it passes, and a parked car seems to be
    until the LiDAR places it."""
    found = []
    for item in situation.objects:
        closing = closing_speed_mps(item)
        if closing is None or closing <= STANDSTILL_MPS or not item.distance_m or item.ttc_s is None:
            continue
        is_lead = situation.lead is not None and item.id == situation.lead.id
        if (is_lead and not item.carried and not item.oncoming and is_there_now(item, params)) or (
            is_dependable(item) and enters_corridor(item, situation.path, situation.lead, params)
        ):
            sigma_m = item.distance_sigma_m or 0.0
            justified = _justified(item, required_decel_mps2(item.distance_m, closing, params))
            required = required_decel_mps2(item.distance_m, _surely_closing_mps(item, closing, params), params)
            found.append(Threat(item.id, item.distance_m, sigma_m, closing, item.ttc_s, required, justified))
    return tuple(found)


def _surely_closing_mps(item: FusedObject, closing_mps: float, params: AebParams) -> float:
    """Its closing speed as far as it is known: that of boxes, ``closing_sigmas`` standard deviations lower. Eight
    sightings at 55 m, the first of which were half a vehicle's, make a car that drives ahead at our speed approach at
    26 ± 9 m/s."""
    return closing_mps - (params.closing_sigmas * (item.camera_speed_sigma_mps or 0.0) if not item.ranged else 0.0)


def _justified(item: FusedObject, required_mps2: float) -> Braking:
    """According to its evidence. But an object that the LiDAR has never measured and that no braking could avoid is not
    trusted."""
    if item.ranged or has_known_height(item):
        return item.justifies
    return min(item.justifies, Braking.PARTIAL) if required_mps2 <= FRICTION_MPS2 else Braking.COMFORT


def _level(threat: Threat, params: AebParams) -> int:
    """The requested stage, no harder than the evidence justifies; a warning only requires the evidence of a lead."""
    if threat.ttc_s < params.full_ttc_s or threat.required_mps2 > params.full_when_mps2:
        return min(_FULL, _WARN + threat.justified)
    if threat.ttc_s < params.partial_ttc_s or threat.required_mps2 > params.partial_when_mps2:
        return min(_PARTIAL, _WARN + threat.justified)
    return _WARN if threat.ttc_s < params.warn_ttc_s else _NONE


def _tracked(state: AebState, threats: Sequence[Threat], dt_s: float) -> AebState:
    """The state with the object braked for where it is now."""
    cause = next((threat for threat in threats if threat.id == state.object_id), None)
    if cause is not None:
        return evolve(state, distance_m=cause.distance_m, closing_mps=cause.closing_mps)
    return evolve(state, distance_m=max(state.distance_m - state.closing_mps * dt_s, 0.0))


def _is_pressing(threat: Threat, state: AebState, params: AebParams) -> bool:
    """Whether this is still the danger that is braked for: its object, or one at its place or nearer. A vehicle clearly
    beyond must ask for a stage itself: if what was braked for turns out to be no danger, the brakes are released."""
    same = threat.id == state.object_id or threat.distance_m - threat.sigma_m <= state.distance_m + _SAME_PLACE_M
    return same and threat.ttc_s < params.release_ttc_s


def _next(
    state: AebState,
    threats: Sequence[Threat],
    worst: Threat | None,
    ego: EgoState,
    dt_s: float,
    params: AebParams,
) -> AebState:
    """The stage that is active now: one requested in enough consecutive frames, or a braking stage that has not
    ended."""
    fast = ego.speed_mps * 3.6 >= params.min_speed_kmh
    asked = _level(worst, params) if worst is not None and fast else _NONE
    streak = tuple(count + 1 if asked > level else 0 for level, count in enumerate(state.streak))
    confirmed = sum(count >= params.confirm_frames for count in streak)
    moving = ego.speed_mps > STANDSTILL_MPS
    pressing = moving and (confirmed >= _PARTIAL or any(_is_pressing(threat, state, params) for threat in threats))
    calm_s = 0.0 if pressing else state.calm_s + dt_s
    over = calm_s >= (params.release_s if moving else params.standstill_s)
    held = state.level if state.level >= _PARTIAL and not over else _NONE
    level = max(confirmed, held)
    if not level:
        return AebState(level, streak, calm_s)
    if worst is not None and confirmed >= held:
        return AebState(level, streak, calm_s, _cause(worst), worst.id, worst.distance_m, worst.closing_mps)
    return evolve(state, level=level, streak=streak, calm_s=calm_s)


def _cause(threat: Threat) -> str:
    if threat.required_mps2 == inf:
        return f"#{threat.id} in {threat.ttc_s:.1f} s, too close to stop in time"
    return f"#{threat.id} in {threat.ttc_s:.1f} s, {threat.required_mps2:.1f} m/s² needed"


def _stronger(command: AccCommand, state: AebState, params: AebParams, pedals: AccParams) -> AccCommand:
    if state.level == _NONE:
        return command
    stage = STAGES[state.level - 1]
    if stage == "warn":
        return evolve(command, state=stage, reason=f"warning: {state.cause}", object_id=state.object_id)
    decel = params.full_decel_mps2 if stage == "full_brake" else params.partial_decel_mps2
    if -command.accel_mps2 > decel:
        return command
    return evolve(
        command,
        state=stage,
        desired_speed_mps=0.0,
        accel_mps2=-decel,
        accelerator=0.0,
        brake=min(decel / pedals.max_decel_mps2, 1.0),
        reason=f"emergency braking: {state.cause}",
        object_id=state.object_id,
    )
