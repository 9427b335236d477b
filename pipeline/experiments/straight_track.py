"""The test track: a straight road with one target, and the outcome of a drive towards it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.common.geometry import closest_on_polygon
from pipeline.evaluation.report_sections import Chart, Series
from pipeline.params import Params, with_changes
from pipeline.simulation.closed_loop import LoopStep, Setup, drive
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.world.actors import Motion
from pipeline.simulation.world.world_state import ActorState

KMH = 1.0 / 3.6
"""One km/h in m/s."""
TARGET = 1
LANE = -2
CONTROLLERS: Mapping[str, Mapping[str, Any]] = {
    "ACC": {"aeb.enabled": False},
    "ACC + AEB": {},
    "AEB": {"acc.brake_limit_mps2": 0.0},
}
"""Parameters that select the controllers. AEB alone: ACC holds the speed, like the driving robot of a test, and never
brakes."""
_NEAR_ENOUGH = 0.25
_STANDING_MPS = 0.05
_BRAKING_MPS2 = 0.5
_PEDAL_TOUCHED = 0.02


def scene(ego_speed: Mapping[float, float], target: Mapping[str, Any], duration_s: float, seed: int) -> Scenario:
    """A straight road of three lanes with one target. ego_speed, and ``speed_mps`` of the target: seconds → m/s.
    target: more of its fields, as in a scenario file; by default it is a car in the ego lane."""
    return Scenario.model_validate(
        {
            "title": "test track",
            "seed": seed,
            "duration_s": duration_s,
            "road": {"segments": [{"length_m": 5000.0}], "lanes_oncoming": 0},
            "ego": {"lane": LANE, "speed_mps": dict(ego_speed)},
            "actors": [{"id": TARGET, "kind": "car", "lane": LANE, **target}],
        }
    )


def car(number: int, lane: int, ahead_m: float, speed_mps: Mapping[float, float]) -> dict[str, Any]:
    """A car as in a scenario file. speed_mps: seconds → m/s."""
    return {"id": number, "kind": "car", "lane": lane, "ahead_m": ahead_m, "speed_mps": dict(speed_mps)}


def parameters(controller: str, set_speed_mps: float, changes: Mapping[str, Any] | None = None) -> Params:
    """The default parameters with the chosen controllers and set speed."""
    set_speed = {"acc.set_speed_kmh": set_speed_mps * 3.6}
    return with_changes(Params(), {**set_speed, **CONTROLLERS[controller], **(changes or {})})


@dataclass(frozen=True)
class DriveRecord:
    """A drive towards the target, one value per tick."""

    t_s: tuple[float, ...]
    """Seconds since the start of the scenario."""
    speed_mps: tuple[float, ...]
    """Speed of the ego vehicle."""
    accel_mps2: tuple[float, ...]
    """Acceleration of the ego vehicle."""
    gap_m: tuple[float, ...]
    """Gap from the bumper to the target's rear."""
    target_mps: tuple[float, ...]
    """Speed of the target."""
    measured_m: tuple[float | None, ...]
    """Distance of the CIPV as measured by the pipeline; None without one."""
    states: tuple[str, ...]
    """States of the controller."""
    acquired_m: float | None
    """Gap when the target first was the CIPV; None if never."""
    brakes_m: float | None
    """Gap when braking was first requested; None if never."""
    impact_mps: float | None
    """Relative speed at contact; None without contact."""
    motions: tuple[Motion, ...] = ()
    """Motion of the ego vehicle; empty if not kept."""

    @property
    def smallest_gap_m(self) -> float:
        return 0.0 if self.impact_mps is not None else min(self.gap_m)

    def peak_decel_mps2(self) -> float:
        return max(0.0, -min(self.accel_mps2))

    def mean_decel_mps2(self) -> float | None:
        """Mean deceleration during the hardest braking: all ticks around its peak with more than 0.5 m/s²."""
        if self.peak_decel_mps2() < _BRAKING_MPS2:
            return None
        first = last = min(range(len(self.accel_mps2)), key=lambda k: self.accel_mps2[k])
        while first > 0 and self.accel_mps2[first - 1] < -_BRAKING_MPS2:
            first -= 1
        while last + 1 < len(self.accel_mps2) and self.accel_mps2[last + 1] < -_BRAKING_MPS2:
            last += 1
        took_s = self.t_s[last] - self.t_s[first]
        return (self.speed_mps[first] - self.speed_mps[last]) / took_s if took_s > 0.0 else None

    def peak_jerk_mps3(self) -> float:
        """Largest change of acceleration between two ticks, divided by the time between them."""
        changes = zip(self.accel_mps2, self.accel_mps2[1:], self.t_s, self.t_s[1:], strict=False)
        return max((abs(b - a) / (t1 - t0) for a, b, t0, t1 in changes), default=0.0)


def approach(scenario: Scenario, setup: Setup, stop_when_over: bool = True) -> DriveRecord:
    """Drive until contact, until the danger is over (optional), or to the end of the scenario."""
    return record(drive(scenario, setup), stop_when_over)


def record(ticks: Iterable[LoopStep], stop_when_over: bool = True) -> DriveRecord:
    rows: list[tuple[float, float, float, float, float, float | None, str]] = []
    motions: list[Motion] = []
    acquired = brakes = impact = None
    for tick in ticks:
        target = target_of(tick)
        gap, speed = gap_m(target), tick.vehicle.speed_mps
        if gap <= 0.0:
            impact = max(rows[-1][1] - rows[-1][4], speed - target.speed_mps) if rows else speed - target.speed_mps
            break
        measured = measured_m(tick, target)
        command = tick.result.acc
        state = command.state if command is not None else "off"
        acquired = gap if acquired is None and measured is not None else acquired
        brakes = gap if brakes is None and command is not None and command.brake > _PEDAL_TOUCHED else brakes
        motions.append(tick.vehicle.motion())
        rows.append((tick.t_s, speed, tick.vehicle.accel_mps2, gap, target.speed_mps, measured, state))
        if stop_when_over and _over(tick, target):
            break
    times, speeds, accels, gaps, targets, measures, states = tuple(zip(*rows, strict=True)) or ((),) * 7
    return DriveRecord(times, speeds, accels, gaps, targets, measures, states, acquired, brakes, impact, tuple(motions))


def drive_charts(drive: DriveRecord) -> tuple[Chart, ...]:
    """Charts of speeds, gap and acceleration over time."""
    t_s = drive.t_s
    seen = [(t, range_m) for t, range_m in zip(t_s, drive.measured_m, strict=True) if range_m is not None]
    seen_s, seen_m = zip(*seen, strict=True) if seen else ((), ())
    own, target = (
        Series(name, t_s, tuple(v * 3.6 for v in speeds))
        for name, speeds in (("own", drive.speed_mps), ("target", drive.target_mps))
    )
    return (
        Chart("Speed", "time s", "km/h", (own, target)),
        Chart("Gap", "time s", "m", (Series("true gap", t_s, drive.gap_m), Series("CIPV", seen_s, seen_m, True))),
        Chart("Acceleration", "time s", "m/s²", (Series("own", t_s, drive.accel_mps2),)),
    )


def _over(tick: LoopStep, target: ActorState) -> bool:
    """Whether the car stands, or has braked to the speed of a target whose speed is constant."""
    speed, accel = tick.vehicle.speed_mps, tick.vehicle.accel_mps2
    return speed < _STANDING_MPS or (accel < -_BRAKING_MPS2 and speed <= target.speed_mps and not target.braking)


def target_of(tick: LoopStep) -> ActorState:
    return next(state for state in tick.world.actors if state.actor.id == TARGET)


def gap_m(target: ActorState) -> float:
    """Metres from the bumper's front to the target's nearest corner ahead; negative inside it."""
    return float(target.cuboid.footprint()[:, 0].min())


def true_range_m(target: ActorState) -> float:
    """Horizontal range from the LiDAR to the target's nearest point."""
    x, y = closest_on_polygon(target.cuboid.footprint())
    return float((x * x + y * y) ** 0.5)


def measured_m(tick: LoopStep, target: ActorState) -> float | None:
    """The CIPV's distance if the CIPV is the target; None otherwise."""
    lead = tick.result.cipv
    if lead is None:
        return None
    truth = true_range_m(target)
    return lead.distance_m if abs(lead.distance_m - truth) <= max(2.0, _NEAR_ENOUGH * truth) else None
