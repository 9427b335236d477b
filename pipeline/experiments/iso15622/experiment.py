"""Experiment: adaptive cruise control, modelled on ISO 15622 (2018). Acquisition range; discriminating two vehicles 3.5
m apart; following through curves of 500, 250 and 125 m radius; stopping behind a lead that brakes at 2.5 m/s²; time gap
in following. ACC alone in the closed loop, braking no harder than the 3.5 m/s² that the standard permits, with the
LiDAR alone and with both sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pipeline.evaluation.report_sections import AnyCell, Chart, Coloured, ReportSection, Scene, Series, Table
from pipeline.experiments.experiment import Experiment, ExperimentDrive
from pipeline.experiments.iso15622.scenarios import BEND_FROM_M, CURVE_LATERAL_MPS2, RADII_M, IsoTest, scenario
from pipeline.experiments.perception import COMPARED, GIVEN_SAID, SENSORS
from pipeline.experiments.straight_track import gap_m, measured_m, parameters, target_of, true_range_m
from pipeline.params import Params
from pipeline.run import Sensors
from pipeline.simulation.closed_loop import Setup, drive
from pipeline.simulation.drive_as_scenario import as_driven
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.world.actors import Motion

FollowingKey = tuple[IsoTest, float, Sensors]
ACC_BRAKE_MPS2 = 3.5
SMALLEST_TIME_GAP_S = 0.8
_MOVING_MPS = 5.0
_KEPT = 0.95


@dataclass(frozen=True)
class FollowingCase:
    """One drive of one test."""

    test: IsoTest
    """Test of the standard."""
    value: float
    """Radius in metres (curve), or speed in km/h (all others)."""
    sensors: Sensors
    """Sensors that the pipeline gets."""
    seed: int
    """Seed of noise and scenery."""

    @property
    def at(self) -> str:
        return f"R = {self.value:g} m" if self.test == "curve" else f"{self.value:g} km/h"

    @property
    def name(self) -> str:
        """Name for use in file names."""
        return f"iso_{self.test}_{self.value:g}_{SENSORS[self.sensors]}_{self.seed}".lower()


@dataclass(frozen=True)
class FollowingOutcome:
    """Outcome of one drive. Tuples have a value for each tick."""

    acquired_m: float | None
    """Distance at which the lead first was the CIPV; None if never."""
    kept: float
    """Share of the frames from then on in which it was the CIPV."""
    smallest_gap_m: float
    """Smallest distance to the lead."""
    smallest_time_gap_s: float | None
    """Smallest ratio of gap to ego speed while driving; None if the car never drove."""
    touched: bool
    """Whether there was contact."""
    t_s: tuple[float, ...]
    """Seconds since the start of the scenario."""
    range_m: tuple[float, ...]
    """Distance to the lead."""
    speed_mps: tuple[float, ...]
    """Speed of the ego vehicle."""
    motions: tuple[Motion, ...] = ()
    """Of the ego vehicle."""


def cases(short: bool) -> list[FollowingCase]:
    plan: dict[IsoTest, tuple[float, ...]] = (
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
        FollowingCase(test, value, sensors, seed)
        for test, values in plan.items()
        for value in values
        for sensors in COMPARED
        for seed in seeds
    ]


def run(case: FollowingCase) -> FollowingOutcome:
    driven = _scenario(case)
    rows: list[_Row] = []
    touched = False
    for tick in drive(driven, Setup(_params(driven), case.sensors)):
        target = target_of(tick)
        touched = case.test != "curve" and gap_m(target) <= 0.0
        if touched:
            break
        counted = case.test != "curve" or tick.world.s_m >= BEND_FROM_M
        seen = measured_m(tick, target) is not None
        rows.append(_Row(tick.t_s, true_range_m(target), tick.vehicle.speed_mps, seen, counted, tick.vehicle.motion()))
    return _outcome(rows, touched)


def _scenario(case: FollowingCase) -> Scenario:
    return scenario(case.test, case.value, case.seed)


def _params(driven: Scenario) -> Params:
    speed = max(driven.ego.speed_mps.values())
    return parameters("ACC", speed, {"acc.brake_limit_mps2": ACC_BRAKE_MPS2})


def as_drive(case: FollowingCase, outcome: FollowingOutcome) -> ExperimentDrive:
    """The drive of one run."""
    driven = _scenario(case)
    title = f"{case.test.capitalize()}, {case.at}: {SENSORS[case.sensors]}, run {case.seed}"
    seen_m, gap_s = outcome.acquired_m, outcome.smallest_time_gap_s
    return ExperimentDrive(
        case.name,
        title,
        (
            "Passed." if passed(outcome) else "Not passed.",
            "Never acquired." if seen_m is None else f"Acquired at {seen_m:.1f} m, kept in {100 * outcome.kept:.0f} %.",
            "Contact." if outcome.touched else f"Smallest gap {outcome.smallest_gap_m:.1f} m.",
            *([f"Smallest time gap {gap_s:.2f} s."] if gap_s is not None else []),
        ),
        as_driven(driven, outcome.motions, title),
        _params(driven),
        case.sensors,
        (
            Chart("Range to the lead", "time s", "range m", (Series("true", outcome.t_s, outcome.range_m),)),
            Chart("Speed", "time s", "m/s", (Series("own", outcome.t_s, outcome.speed_mps),)),
        ),
    )


class _Row(NamedTuple):
    """One tick. seen: the lead is the CIPV. counted: the tick counts for ``kept``. motion: the ego vehicle's."""

    t_s: float
    range_m: float
    speed_mps: float
    seen: bool
    counted: bool
    motion: Motion


def _outcome(rows: list[_Row], touched: bool) -> FollowingOutcome:
    first = next((n for n, row in enumerate(rows) if row.seen), None)
    after = [row for row in rows[first:] if row.counted] if first is not None else []
    time_gaps = [row.range_m / row.speed_mps for row in rows if row.speed_mps > _MOVING_MPS]
    return FollowingOutcome(
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


def report(cases: Sequence[FollowingCase], outcomes: Sequence[FollowingOutcome]) -> ReportSection:
    driven: dict[FollowingKey, dict[FollowingCase, FollowingOutcome]] = {}
    for case, outcome in zip(cases, outcomes, strict=True):
        driven.setdefault((case.test, case.value, case.sensors), {})[case] = outcome
    groups = {key: list(by_case.values()) for key, by_case in driven.items()}
    rows = tuple(_row(by_case) for by_case in driven.values())
    return ReportSection(
        "iso",
        "ACC, modelled on ISO 15622",
        (
            f"ACC alone, braking at {ACC_BRAKE_MPS2:g} m/s² at most. Acquired: the mean distance at which the lead "
            "first becomes the CIPV. Kept: share of the later frames in which it is the CIPV. Passed: no contact, kept "
            f"in {100 * _KEPT:.0f} % of the frames, time gap never under {SMALLEST_TIME_GAP_S} s. Curves are driven at "
            f"{CURVE_LATERAL_MPS2:g} m/s² of lateral acceleration, and kept counts from where the radius is constant, "
            "as in the standard: in the transition before it, the current yaw rate bends the path too little.",
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


def _row(by_case: dict[FollowingCase, FollowingOutcome]) -> tuple[AnyCell, ...]:
    """The runs of one test with one set of sensors; the last cell links to the first one that failed."""
    first, group = next(iter(by_case)), list(by_case.values())
    shown = next((case for case, each in by_case.items() if not passed(each)), first)
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


def passed(outcome: FollowingOutcome) -> bool:
    gap = outcome.smallest_time_gap_s
    return not outcome.touched and outcome.kept >= _KEPT and (gap is None or gap >= SMALLEST_TIME_GAP_S)


def _verdicts(groups: dict[FollowingKey, list[FollowingOutcome]]) -> list[str]:
    """For each test, how many runs pass with each set of sensors."""
    found = []
    for test in dict.fromkeys(key[0] for key in groups):
        count = {
            sensors: [
                passed(each) for key, group in groups.items() if key[0] == test and key[2] == sensors for each in group
            ]
            for sensors in COMPARED
        }
        better = "better than" if sum(count["both"]) > sum(count["lidar"]) else "no better than"
        found.append(
            f"{test.capitalize()}: fused passes {sum(count['both'])} of {len(count['both'])} runs, {better} the LiDAR "
            f"alone ({sum(count['lidar'])} of {len(count['lidar'])})."
        )
    return found


def _chart(test: IsoTest, value: float, groups: dict[FollowingKey, list[FollowingOutcome]]) -> Chart:
    name = f"R = {value:g} m" if test == "curve" else f"{value:g} km/h"
    lines = tuple(
        Series(SENSORS[sensors], groups[test, value, sensors][0].t_s, groups[test, value, sensors][0].range_m)
        for sensors in COMPARED
        if (test, value, sensors) in groups
    )
    return Chart(f"{test}, {name}: range to the lead", "time s", "range m", lines)


ISO = Experiment("iso", "iso", "ACC, modelled on ISO 15622", cases, run, report, as_drive)
