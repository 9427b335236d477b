"""Judges one drive's results against ground truth: phantom leads, phantom braking, missed leads, switches of the lead.

A phantom is a lead or braking where the car could not meet any vehicle. Vehicles in the driven path, vehicles so near
to its edge that either answer is right, and vehicles that enter it within three seconds are no phantoms. A vehicle is
recognised by its place, or else by its box in the image, even if the place is that of another vehicle: then the lead
is not invented but misplaced, a failure of its own. Braking for it counts as phantom braking, because the place is what
the car brakes for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

from pipeline.common.geometry import closest_on_polygon
from pipeline.decision.object_motion import required_decel_mps2
from pipeline.experiments.robustness.true_vehicles import (
    how_misplaced,
    is_hit,
    named,
    place,
    seen_by,
    vehicle_in_box,
    vehicles_at,
    what,
    why_missed,
)
from pipeline.experiments.true_lead import (
    EDGE_M,
    MAX_M,
    VISIBLE_SHARE,
    ScriptedWay,
    overlap,
    same_place,
    true_lead,
)
from pipeline.params import AebParams, CipvParams
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.truth_boxes import in_image
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import ActorState, World
from pipeline.types import CameraCalibration, FusedObject, Path, Result

Kind = Literal[
    "phantom full braking",
    "phantom partial braking",
    "phantom comfort braking",
    "phantom lead",
    "phantom next lead",
    "lead misplaced",
    "lead missed",
    "lead late",
    "switch",
]
KINDS: tuple[Kind, ...] = get_args(Kind)
MISSED_S = 0.5
"""Time for which a lead may be missed, and by which it may be found later than its confirmation takes."""
_SOON_S = (0.75, 1.5, 2.25, 3.0)
_BRAKES_MPS2, _PARTIAL_MPS2, _FULL_MPS2 = 0.5, 3.6, 5.5
_NO_NEED_MPS2, _NO_NEED_TTC_S = 2.0, 4.0
"""A true vehicle does not justify an emergency stage if it requires less deceleration than this and has a longer
TTC."""
_JOINS_S = 0.5
"""Two moments of the same failure are at most this far apart."""
_SEVERITY: tuple[Kind, ...] = ("phantom comfort braking", "phantom partial braking", "phantom full braking")


@dataclass(frozen=True)
class Failure:
    """A failure and its time span."""

    kind: Kind
    """Kind of failure."""
    cause: str
    """Cause, as text by which failures are grouped."""
    from_s: float
    """Start, in seconds since the start of the drive."""
    to_s: float
    """End; the same as ``from_s`` for a single moment."""
    text: str
    """Description of what the pipeline believed."""

    @property
    def lasts_s(self) -> float:
        return self.to_s - self.from_s


@dataclass
class _Reign:
    """A true lead, and since when it leads."""

    lead: int | None = None
    could_s: float = 0.0
    wrong_s: float = 0.0
    told: bool = False
    was_right: bool = False
    chosen: int | None = None


@dataclass
class Judge:
    """Judges the results of a drive one by one."""

    scenario: Scenario
    """The scenario, whose traffic is the ground truth."""
    step_s: float
    """Time between two results."""
    failures: list[Failure] = field(default_factory=list)
    """Failures that have ended so far."""
    reign: _Reign = field(default_factory=_Reign)
    """The current true lead, and since when it leads."""
    is_over: bool = False
    """Whether the ego vehicle has hit another."""

    def __post_init__(self) -> None:
        self._way = ScriptedWay.of(self.scenario)
        self._aeb, self._confirm_s = AebParams(), CipvParams().confirm_hits * self.step_s

    def take(self, now: World, camera: CameraCalibration | None, result: Result) -> None:
        """Judge one tick. The script does not brake, so it may drive into a vehicle, as where roadworks make it change
        lanes: from there on, nothing is judged."""
        self.is_over = self.is_over or any(is_hit(state) for state in now.actors)
        path = self._way.ahead(now)
        if path is None or self.is_over:
            return
        lead, doubtful = true_lead(now, path)
        chosen = result.chosen()
        self._judge_choice(now, path, camera, chosen)
        self._judge_next(now, path, camera, result)
        self._judge_braking(now, path, camera, result)
        self._judge_lead(now, camera, lead, doubtful, chosen)

    def _judge_choice(
        self, now: World, path: Path, camera: CameraCalibration | None, chosen: FusedObject | None
    ) -> None:
        where = place(chosen)
        if chosen is None or where is None or (chosen.distance_m or 0.0) >= MAX_M:
            return
        met = vehicles_at(now, where)
        if any(_in_path(state, path) for state in met) or self._comes_in(now, met):
            return
        text = f"#{chosen.id} at {chosen.distance_m:.1f} m"
        boxed = vehicle_in_box(now, camera, chosen)
        if boxed is not None and _in_path(boxed, path):
            self._fail("lead misplaced", how_misplaced(boxed, where), now.t_s, f"{text} is {named(boxed)}")
            return
        self._fail("phantom lead", f"{what(met)}, by {seen_by(chosen)}", now.t_s, text)

    def _judge_next(self, now: World, path: Path, camera: CameraCalibration | None, result: Result) -> None:
        """A next lead, too, is a vehicle that the car could meet, or its box is that of one."""
        told = result.next_cipv
        item = next((each for each in result.objects if told is not None and each.id == told.id), None)
        where = place(item)
        if told is None or item is None or where is None or told.distance_m >= MAX_M:
            return
        met = vehicles_at(now, where)
        boxed = vehicle_in_box(now, camera, item)
        seen = met if boxed is None or boxed in met else [*met, boxed]
        if not any(_in_path(state, path) for state in seen) and not self._comes_in(now, seen):
            self._fail("phantom next lead", f"{what(met)}, by {seen_by(item)}", now.t_s, f"#{told.id} {told.reason}")

    def _judge_braking(self, now: World, path: Path, camera: CameraCalibration | None, result: Result) -> None:
        acc = result.acc
        if acc is None or acc.object_id is None or acc.accel_mps2 > -_BRAKES_MPS2:
            return
        item = next((each for each in result.objects if each.id == acc.object_id), None)
        where = place(item)
        if acc.state == "full_brake" or acc.accel_mps2 < -_FULL_MPS2:
            level = 2
        else:
            level = 1 if acc.state == "partial_brake" or acc.accel_mps2 < -_PARTIAL_MPS2 else 0
        met = vehicles_at(now, where) if where is not None else []
        due = [state for state in met if _in_path(state, path)] or self._comes_in(now, met)
        if due:
            # not a phantom: the gap law brakes hard for a true lead if the script follows it closer than ACC would
            is_emergency = acc.state in ("partial_brake", "full_brake")
            if not is_emergency or any(self._needs_braking(now, state) for state in due):
                return
            cause = f"wrong speed of a true vehicle, by {seen_by(item)}"
        elif where is not None and (boxed := vehicle_in_box(now, camera, item)) is not None and boxed not in met:
            cause = f"{how_misplaced(boxed, where)}, by {seen_by(item)}"
        else:
            cause = f"{what(met)}, by {seen_by(item)}"
        self._fail(_SEVERITY[level], cause, now.t_s, acc.reason)

    def _judge_lead(
        self,
        now: World,
        camera: CameraCalibration | None,
        lead: ActorState | None,
        doubtful: bool,
        chosen: FusedObject | None,
    ) -> None:
        number = lead.actor.id if lead is not None else None
        if number != self.reign.lead:
            self.reign = _Reign(number)
        if lead is None or doubtful:
            self.reign.wrong_s, self.reign.chosen = 0.0, None
            return
        if chosen is not None and self._is_it(now, camera, chosen, lead):
            before = self.reign.chosen
            if before is not None and before != chosen.id:
                self._fail("switch", "", now.t_s, f"#{before} → #{chosen.id}")
            self.reign.chosen, self.reign.was_right = chosen.id, True
            self.reign.wrong_s, self.reign.told = 0.0, False
            return
        if camera is not None and _is_hidden(now, camera, lead):
            self.reign.could_s = self.reign.wrong_s = 0.0
            return
        self.reign.could_s += self.step_s
        self.reign.wrong_s += self.step_s
        allowed = MISSED_S if self.reign.was_right else MISSED_S + self._confirm_s
        if self.reign.wrong_s > allowed + 1e-6:
            kind: Kind = "lead missed" if self.reign.was_right else "lead late"
            self._fail(kind, why_missed(lead, chosen), now.t_s, f"true lead {lead.actor.kind} {number}")

    def _is_it(self, now: World, camera: CameraCalibration | None, chosen: FusedObject, lead: ActorState) -> bool:
        """Whether the chosen object is this vehicle, even if misplaced."""
        where = place(chosen)
        return where is not None and (same_place(where, lead) or vehicle_in_box(now, camera, chosen) is lead)

    def _comes_in(self, now: World, met: Sequence[ActorState]) -> list[ActorState]:
        """The vehicles among ``met`` that will soon be in the path, or have just been."""
        if not met:
            return []
        wanted = {state.actor.id for state in met}
        for later_s in (*_SOON_S, -0.75):
            then = world_state.at(self.scenario, max(now.t_s + later_s, 0.0))
            path = self._way.ahead(then)
            if path is None:
                continue
            for state in then.actors:
                if state.actor.id in wanted and _in_path(state, path, behind_m=3.0):
                    return [state for state in met]
        return []

    def _needs_braking(self, now: World, state: ActorState) -> bool:
        """Whether a true vehicle could justify an emergency stage, with a margin."""
        x, y = closest_on_polygon(state.cuboid.footprint())
        gap_m = max((x * x + y * y) ** 0.5, 0.1)
        later = world_state.at(self.scenario, now.t_s + 0.1)
        then = next((each for each in later.actors if each.actor.id == state.actor.id), None)
        if then is None:
            return True
        x, y = closest_on_polygon(then.cuboid.footprint())
        closing = (gap_m - (x * x + y * y) ** 0.5) / 0.1
        if closing <= 0.1:
            return gap_m < 3.0
        needed = required_decel_mps2(gap_m, closing, self._aeb)
        return needed > _NO_NEED_MPS2 or gap_m / closing < _NO_NEED_TTC_S

    def _fail(self, kind: Kind, cause: str, t_s: float, text: str) -> None:
        """Add a failure, or extend the ongoing one. Harder braking replaces softer braking."""
        for n in range(len(self.failures) - 1, -1, -1):
            last = self.failures[n]
            if t_s - last.to_s > _JOINS_S or kind == "switch":
                break
            if last.kind in _SEVERITY and kind in _SEVERITY:
                harder = max(last.kind, kind, key=_SEVERITY.index)
                told = (cause, text) if harder != last.kind else (last.cause, last.text)
                self.failures[n] = Failure(harder, told[0], last.from_s, t_s, told[1])
                return
            if last.kind == kind:
                self.failures[n] = replace(last, to_s=t_s)
                return
        self.failures.append(Failure(kind, cause, t_s, t_s, text))


def _in_path(state: ActorState, path: Path, behind_m: float = 0.0) -> bool:
    """Whether a vehicle is in the path, or so close to its edge that either answer is correct."""
    too_little, nearest = overlap(state, path)
    return too_little > -EDGE_M and nearest > -behind_m


def _is_hidden(now: World, camera: CameraCalibration, lead: ActorState) -> bool:
    seen = next((each for each in in_image(now, camera) if each.actor.actor.id == lead.actor.id), None)
    return seen is not None and seen.visible < VISIBLE_SHARE
