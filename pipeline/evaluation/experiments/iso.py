"""Experiment: adaptive cruise control after the manner of ISO 15622 (2018).

Acquisition range; telling two vehicles 3.5 m apart; following through curves of 500, 250 and 125 m radius; stopping
behind a lead that brakes at 2.5 m/s²; time gap in following. ACC alone in the closed loop, braking no harder than the
3.5 m/s² that the standard permits, with the LiDAR alone and with both sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any, Literal, NamedTuple

from pipeline.evaluation.experiments.sections import (
    GIVEN_SAID,
    AnyCell,
    Chart,
    Coloured,
    Experiment,
    Replay,
    Scene,
    Section,
    Series,
    Table,
)
from pipeline.evaluation.experiments.track import TARGET, gap_m, measured_m, parameters, target_of, true_range_m
from pipeline.params import Params
from pipeline.run import Sensors
from pipeline.simulation.actors import Motion
from pipeline.simulation.loop import Setup, drive
from pipeline.simulation.replay import as_driven
from pipeline.simulation.scenario import Scenario

Test = Literal["acquisition", "discrimination", "curve", "stop", "following"]
SENSORS: dict[Sensors, str] = {"lidar": "LiDAR", "both": "fused"}
ACC_BRAKE_MPS2 = 3.5
LEAD_BRAKE_MPS2 = 2.5
SMALLEST_TIME_GAP_S = 0.8
RADII_M = (500.0, 250.0, 125.0)
CURVE_LATERAL_MPS2 = 2.0
_LANE_M = 3.5
_MOVING_MPS = 5.0
_BEND_FROM_M, _TRANSITION_M = 210.0, 30.0
_KEPT = 0.95


@dataclass(frozen=True)
class Case:
    """value: radius, m (curve), or speed, km/h (all others)."""

    test: Test
    value: float
    sensors: Sensors
    seed: int

    @property
    def at(self) -> str:
        return f"R = {self.value:g} m" if self.test == "curve" else f"{self.value:g} km/h"

    @property
    def name(self) -> str:
        """Fit for a file."""
        return f"iso_{self.test}_{self.value:g}_{SENSORS[self.sensors]}_{self.seed}".lower()


@dataclass(frozen=True)
class Outcome:
    """acquired_m: range when the lead first was the CIPV, null if never. kept: share of the frames from then on in
    which it was. smallest_gap_m: range to the lead. smallest_time_gap_s: that over own speed, while driving; null when
    it never drove. touched: there was contact. t_s, range_m, speed_mps, motions of the ego vehicle: each tick."""

    acquired_m: float | None
    kept: float
    smallest_gap_m: float
    smallest_time_gap_s: float | None
    touched: bool
    t_s: tuple[float, ...]
    range_m: tuple[float, ...]
    speed_mps: tuple[float, ...]
    motions: tuple[Motion, ...] = ()


def cases(short: bool) -> list[Case]:
    plan: dict[Test, tuple[float, ...]] = (
        {"stop": (50.0,)}
        if short
        else {
            "acquisition": (50.0, 80.0),
            "discrimination": (60.0, 90.0),
            "curve": RADII_M,
            "stop": (50.0, 72.0),
            "following": (60.0, 90.0),
        }
    )
    seeds = range(1 if short else 3)
    return [
        Case(test, value, sensors, seed)
        for test, values in plan.items()
        for value in values
        for sensors in SENSORS
        for seed in seeds
    ]


def run(case: Case) -> Outcome:
    scenario = _scenario(case)
    rows: list[_Row] = []
    touched = False
    for tick in drive(scenario, Setup(_params(scenario), case.sensors)):
        target = target_of(tick)
        touched = case.test != "curve" and gap_m(target) <= 0.0
        if touched:
            break
        counted = case.test != "curve" or tick.world.s_m >= _BEND_FROM_M
        seen = measured_m(tick, target) is not None
        rows.append(_Row(tick.t_s, true_range_m(target), tick.vehicle.speed_mps, seen, counted, tick.vehicle.motion()))
    return _outcome(rows, touched)


def _params(scenario: Scenario) -> Params:
    speed = max(scenario.ego.speed_mps.values())
    return parameters("ACC", speed, {"acc.brake_limit_mps2": ACC_BRAKE_MPS2})


def replay(case: Case, outcome: Outcome) -> Replay:
    """The drive of one run."""
    scenario = _scenario(case)
    title = f"{case.test.capitalize()}, {case.at}: {SENSORS[case.sensors]}, run {case.seed}"
    seen_m, gap_s = outcome.acquired_m, outcome.smallest_time_gap_s
    return Replay(
        case.name,
        title,
        (
            "Passed." if passed(outcome) else "Not passed.",
            "Never acquired." if seen_m is None else f"Acquired at {seen_m:.1f} m, kept in {100 * outcome.kept:.0f} %.",
            "Contact." if outcome.touched else f"Smallest gap {outcome.smallest_gap_m:.1f} m.",
            *([f"Smallest time gap {gap_s:.2f} s."] if gap_s is not None else []),
        ),
        as_driven(scenario, outcome.motions, title),
        _params(scenario),
        case.sensors,
        (
            Chart("Range to the lead", "time s", "range m", (Series("true", outcome.t_s, outcome.range_m),)),
            Chart("Speed", "time s", "m/s", (Series("own", outcome.t_s, outcome.speed_mps),)),
        ),
    )


class _Row(NamedTuple):
    """One tick. seen: the lead is the CIPV. counted: the tick counts for whether it is kept. motion: the ego
    vehicle's."""

    t_s: float
    range_m: float
    speed_mps: float
    seen: bool
    counted: bool
    motion: Motion


def _outcome(rows: list[_Row], touched: bool) -> Outcome:
    first = next((n for n, row in enumerate(rows) if row.seen), None)
    after = [row for row in rows[first:] if row.counted] if first is not None else []
    time_gaps = [row.range_m / row.speed_mps for row in rows if row.speed_mps > _MOVING_MPS]
    return Outcome(
        acquired_m=rows[first].range_m if first is not None else None,
        kept=sum(row.seen for row in after) / len(after) if after else 0.0,
        smallest_gap_m=0.0 if touched else min(row.range_m for row in rows),
        smallest_time_gap_s=min(time_gaps, default=None),
        touched=touched,
        t_s=tuple(row.t_s for row in rows),
        range_m=tuple(row.range_m for row in rows),
        speed_mps=tuple(row.speed_mps for row in rows),
        motions=tuple(row.motion for row in rows),
    )


def _scenario(case: Case) -> Scenario:
    speed = case.value / 3.6
    match case.test:
        case "acquisition":
            return _drive(case, speed, [_car(TARGET, 0, 130.0, {0.0: 0.5 * speed})], 18.0)
        case "discrimination":
            gap = 5.0 + 1.8 * speed
            beside = [_car(2, 1, gap - 8.0, {0.0: speed}), _car(3, -1, gap - 4.0, {0.0: speed})]
            return _drive(case, speed, [_car(TARGET, 0, gap, {0.0: speed}), *beside], 12.0)
        case "curve":
            speed = sqrt(CURVE_LATERAL_MPS2 * case.value)
            slows = {0.0: speed, 9.0: speed, 11.0: 0.8 * speed}
            bend = [
                {"length_m": _BEND_FROM_M - _TRANSITION_M},
                {"length_m": _TRANSITION_M, "end_curvature_per_m": 1.0 / case.value},
                {"length_m": 2000.0, "radius_m": case.value},
            ]
            return _drive(case, speed, [_car(TARGET, 0, 5.0 + 1.8 * speed, slows)], 16.0, bend)
        case "stop":
            brake = {"at_s": 4.0, "decel_mps2": LEAD_BRAKE_MPS2}
            lead = {**_car(TARGET, 0, 5.0 + 1.8 * speed, {0.0: speed}), "brake": brake}
            return _drive(case, speed, [lead], 22.0)
        case "following":
            waves = {0.0: 0.75 * speed, 14.0: 0.75 * speed, 18.0: 0.6 * speed, 24.0: 0.8 * speed}
            return _drive(case, speed, [_car(TARGET, 0, 70.0, waves)], 32.0)


def _car(number: int, lanes_left: int, ahead_m: float, speed_mps: dict[float, float]) -> dict[str, Any]:
    return {"id": number, "kind": "car", "lane": -2 + lanes_left, "ahead_m": ahead_m, "speed_mps": speed_mps}


def _drive(
    case: Case,
    speed_mps: float,
    actors: list[dict[str, Any]],
    duration_s: float,
    segments: list[dict[str, float]] | None = None,
) -> Scenario:
    return Scenario.model_validate(
        {
            "title": f"{case.test} {case.value:g}",
            "seed": case.seed,
            "duration_s": duration_s,
            "road": {"segments": segments or [{"length_m": 5000.0}], "lanes_oncoming": 0, "lane_width_m": _LANE_M},
            "ego": {"lane": -2, "speed_mps": {0.0: speed_mps}},
            "actors": actors,
        }
    )


def report(cases: Sequence[Case], outcomes: Sequence[Outcome]) -> Section:
    groups: dict[tuple[Test, float, Sensors], list[Outcome]] = {}
    names: dict[tuple[Test, float, Sensors], list[Case]] = {}
    for case, outcome in zip(cases, outcomes, strict=True):
        groups.setdefault((case.test, case.value, case.sensors), []).append(outcome)
        names.setdefault((case.test, case.value, case.sensors), []).append(case)
    rows = tuple(_row(names[key], group) for key, group in groups.items())
    return Section(
        "iso",
        "ACC after the manner of ISO 15622",
        (
            f"ACC alone, braking at {ACC_BRAKE_MPS2:g} m/s² at most. Acquisition: the range at which the lead first is "
            "the CIPV (mean). Kept: share of the frames from then on in which it still is. Passed: no contact, kept in "
            f"{100 * _KEPT:.0f} % of the frames, time gap never under {SMALLEST_TIME_GAP_S} s. Curves are driven at "
            f"{CURVE_LATERAL_MPS2:g} m/s² of lateral acceleration, and kept counts from where the radius is constant, "
            "as in the standard: in the transition before it the yaw rate of the moment bends the path too little.",
            GIVEN_SAID,
            *_verdicts(groups),
        ),
        (Table("Tests", _COLUMNS, rows),),
        tuple(_chart(test, value, groups) for test, value in dict.fromkeys((key[0], key[1]) for key in groups)),
        scenes=tuple(
            Scene(f"{case.test.capitalize()}, {case.at}", scene, scene.duration_s / 2)
            for case in {case.test: case for case in cases}.values()
            for scene in (_scenario(case),)
        ),
    )


_COLUMNS = (
    "test",
    "at",
    "sensors",
    "runs",
    "acquired at m",
    "kept %",
    "smallest gap m",
    "smallest time gap s",
    "passed",
)


def _row(cases: list[Case], group: list[Outcome]) -> tuple[AnyCell, ...]:
    """The runs of one test with one set of sensors; its last cell leads to the first that did not pass."""
    first = cases[0]
    shown = next((case for case, each in zip(cases, group, strict=True) if not passed(each)), first)
    acquired = [each.acquired_m for each in group if each.acquired_m is not None]
    gaps = [each.smallest_time_gap_s for each in group if each.smallest_time_gap_s is not None]
    good = all(passed(each) for each in group)
    return (
        first.test,
        first.at,
        SENSORS[first.sensors],
        len(group),
        sum(acquired) / len(acquired) if acquired else None,
        100.0 * sum(each.kept for each in group) / len(group),
        min(each.smallest_gap_m for each in group),
        min(gaps, default=None),
        Coloured("yes" if good else "no", "green" if good else "red", shown.name),
    )


def passed(outcome: Outcome) -> bool:
    gap = outcome.smallest_time_gap_s
    return not outcome.touched and outcome.kept >= _KEPT and (gap is None or gap >= SMALLEST_TIME_GAP_S)


def _verdicts(groups: dict[tuple[Test, float, Sensors], list[Outcome]]) -> list[str]:
    """Test by test: how many of its runs pass with each set of sensors."""
    found = []
    for test in dict.fromkeys(key[0] for key in groups):
        count = {
            sensors: [
                passed(each) for key, group in groups.items() if key[0] == test and key[2] == sensors for each in group
            ]
            for sensors in SENSORS
        }
        better = "better than" if sum(count["both"]) > sum(count["lidar"]) else "no better than"
        found.append(
            f"{test.capitalize()}: fused passes {sum(count['both'])} of {len(count['both'])} runs, {better} the LiDAR "
            f"alone ({sum(count['lidar'])} of {len(count['lidar'])})."
        )
    return found


def _chart(test: Test, value: float, groups: dict[tuple[Test, float, Sensors], list[Outcome]]) -> Chart:
    name = f"R = {value:g} m" if test == "curve" else f"{value:g} km/h"
    lines = tuple(
        Series(SENSORS[sensors], groups[test, value, sensors][0].t_s, groups[test, value, sensors][0].range_m)
        for sensors in SENSORS
        if (test, value, sensors) in groups
    )
    return Chart(f"{test}, {name}: range to the lead", "time s", "range m", lines)


ISO = Experiment("iso", "iso", "ACC after the manner of ISO 15622", cases, run, report, replay)
