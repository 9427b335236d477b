"""Experiment: three braking manoeuvres in the closed loop (paper, section AEB test).

CCRs: 100 km/h towards a standing car. CCRm: 50 km/h towards one that drives 20 km/h. CCRb: both at 50 km/h, 50 m apart,
and the lead brakes at 6 m/s² to standstill. The LiDAR alone compared with both sensors, and ACC alone with ACC and AEB.

The paper reports no drives, only the constant deceleration that its detection ranges would require: ``closed_forms``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import mean

from pipeline.evaluation.report_sections import AnyCell, Chart, Driven, ReportSection, Scene, Series, Table
from pipeline.experiments.experiment import Experiment, ExperimentDrive
from pipeline.experiments.paper.closed_forms import LEAD_DECEL_MPS2, PAPER, Manoeuvre, closed_forms
from pipeline.experiments.perception import COMPARED, SENSORS, Boxes, boxes_said, detections_for, eyes_for
from pipeline.experiments.straight_track import KMH, DriveRecord, approach, drive_charts, parameters, scene
from pipeline.params import Params
from pipeline.run import Sensors
from pipeline.simulation.closed_loop import Setup
from pipeline.simulation.drive_as_scenario import as_driven
from pipeline.simulation.scenario import Scenario

BrakingKey = tuple[Manoeuvre, Sensors, str, Boxes]
_LEAD_BRAKES_AT_S = 2.0
_SHOWN_AT_S: dict[Manoeuvre, float] = {"CCRs": 3.0, "CCRm": 7.0, "CCRb": 3.0}
_CLEAR_MPS, _CLEAR_M = 0.3, 0.3
"""Smallest difference in impact speed or gap that counts as better."""


@dataclass(frozen=True)
class BrakingCase:
    """One manoeuvre, driven once."""

    manoeuvre: Manoeuvre
    """One of the paper's three manoeuvres."""
    sensors: Sensors
    """Sensors that the pipeline gets."""
    controller: str
    """``ACC`` or ``ACC + AEB``."""
    seed: int
    """Seed of noise and scenery."""
    boxes: Boxes = "truth"
    """Source of the camera's boxes."""

    @property
    def key(self) -> BrakingKey:
        """What runs that differ only by their seed have in common."""
        return self.manoeuvre, self.sensors, self.controller, self.boxes

    @property
    def name(self) -> str:
        """Name for use in file names."""
        controller = self.controller.replace(" + ", "+")
        return f"{self.manoeuvre}_{SENSORS[self.sensors]}_{controller}_{self.boxes}_{self.seed}".lower()


def cases(short: bool) -> list[BrakingCase]:
    manoeuvres: tuple[Manoeuvre, ...] = ("CCRs",) if short else ("CCRs", "CCRm", "CCRb")
    fast = [
        BrakingCase(manoeuvre, sensors, controller, seed)
        for manoeuvre in manoeuvres
        for sensors in COMPARED
        for controller in ("ACC", "ACC + AEB")
        for seed in range(1 if short else 10)
    ]
    if short:
        return fast
    return fast + [BrakingCase(each, "both", "ACC + AEB", seed, "network") for each in manoeuvres for seed in range(3)]


def run(case: BrakingCase) -> DriveRecord:
    """Drive one manoeuvre."""
    setup = Setup(_params(case), case.sensors, eyes_for(case.boxes))
    return approach(_scenario(case), setup, stop_when_over=case.manoeuvre != "CCRm")


def _scenario(case: BrakingCase) -> Scenario:
    speed = PAPER[case.manoeuvre].speed_kmh * KMH
    target, duration_s = _target(case.manoeuvre, speed)
    return scene({0.0: speed}, target, duration_s, case.seed)


def _params(case: BrakingCase) -> Params:
    return parameters(case.controller, PAPER[case.manoeuvre].speed_kmh * KMH)


def as_drive(case: BrakingCase, drive: DriveRecord) -> ExperimentDrive:
    """The drive of one run."""
    title = f"{case.manoeuvre}: {_label(case)}, run {case.seed}"
    impact = f"Impact at {drive.impact_mps / KMH:.0f} km/h." if drive.impact_mps is not None else "No impact."
    return ExperimentDrive(
        case.name,
        title,
        (impact, f"Smallest gap {drive.smallest_gap_m:.1f} m."),
        as_driven(_scenario(case), drive.motions, title),
        _params(case),
        case.sensors,
        drive_charts(drive),
        detections_for(case.boxes),
    )


def _label(case: BrakingCase) -> str:
    return f"{SENSORS[case.sensors]}, {case.controller}{boxes_said(case.boxes)}"


def _target(manoeuvre: Manoeuvre, speed_mps: float) -> tuple[dict[str, object], float]:
    """The target, and the length of the drive in seconds."""
    if manoeuvre == "CCRs":
        return {"ahead_m": 120.0, "speed_mps": {0.0: 0.0}, "colour": "#a3202a"}, 15.0
    if manoeuvre == "CCRm":
        return {"ahead_m": 100.0, "speed_mps": {0.0: 20.0 * KMH}, "colour": "#a3202a"}, 25.0
    brakes_until = _LEAD_BRAKES_AT_S + speed_mps / LEAD_DECEL_MPS2
    return {
        "ahead_m": 50.0,
        "speed_mps": {0.0: speed_mps, _LEAD_BRAKES_AT_S: speed_mps, brakes_until: 0.0},
        "colour": "#a3202a",
    }, 20.0


def report(cases: Sequence[BrakingCase], drives: Sequence[DriveRecord]) -> ReportSection:
    done = list(zip(cases, drives, strict=True))
    groups = dict.fromkeys(case.key for case in cases)
    rows = [_row(key, {case.name: drive for case, drive in done if case.key == key}) for key in groups]
    manoeuvres = list(dict.fromkeys(case.manoeuvre for case in cases))
    return ReportSection(
        "braking",
        "Braking: CCRs, CCRm and CCRb in the closed loop",
        (
            "Means over the runs; the smallest gap and the impact speed are those of the worst run and link to it. "
            "Impact speed is relative to the target. Boxes: where the camera's boxes come from, projected ground truth "
            "with a detector's errors or the embedded network on rendered images.",
            *(_verdict(manoeuvre, done) for manoeuvre in manoeuvres),
        ),
        (Table("Drives", _COLUMNS, tuple(rows)), closed_forms()),
        tuple(chart for manoeuvre in manoeuvres for chart in _charts(manoeuvre, done)),
        scenes=tuple(
            Scene(each, _scenario(BrakingCase(each, "both", "ACC + AEB", 0)), _SHOWN_AT_S[each]) for each in manoeuvres
        ),
    )


_COLUMNS = (
    "manoeuvre",
    "sensors",
    "controller",
    "boxes",
    "runs",
    "acquired at m",
    "braked from m",
    "mean m/s²",
    "peak m/s²",
    "jerk m/s³",
    "smallest gap m",
    "impacts",
    "impact km/h",
)


def _row(key: BrakingKey, by_name: dict[str, DriveRecord]) -> tuple[AnyCell, ...]:
    drives = list(by_name.values())
    worst = max(by_name, key=lambda name: (by_name[name].impact_mps or 0.0, -by_name[name].smallest_gap_m))
    impacts = [drive.impact_mps / KMH for drive in drives if drive.impact_mps is not None]
    return (
        key[0],
        SENSORS[key[1]],
        key[2],
        key[3] if key[1] != "lidar" else None,
        len(drives),
        _mean(drive.acquired_m for drive in drives),
        _mean(drive.brakes_m for drive in drives),
        _mean(drive.mean_decel_mps2() for drive in drives),
        max(drive.peak_decel_mps2() for drive in drives),
        max(drive.peak_jerk_mps3() for drive in drives),
        Driven(min(drive.smallest_gap_m for drive in drives), worst),
        len(impacts),
        Driven(max(impacts, default=None), worst),
    )


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return mean(known) if known else None


def _verdict(manoeuvre: Manoeuvre, done: list[tuple[BrakingCase, DriveRecord]]) -> str:
    """Both sensors compared with the LiDAR alone, with AEB, as a sentence."""

    def worst(sensors: Sensors) -> tuple[float, float]:
        """Impact speed (0 without one) and negated gap: smaller is better."""
        return max(
            (drive.impact_mps or 0.0, -drive.smallest_gap_m)
            for case, drive in done
            if case.key == (manoeuvre, sensors, "ACC + AEB", "truth")
        )

    lidar, fused = worst("lidar"), worst("both")
    slower, farther = lidar[0] - fused[0], lidar[1] - fused[1]
    better = "better than" if slower > _CLEAR_MPS or (slower >= 0.0 and farther > _CLEAR_M) else "no better than"
    return f"{manoeuvre}: with AEB, fused ends {_ends(fused)} at worst, {better} the LiDAR alone ({_ends(lidar)})."


def _ends(worst: tuple[float, float]) -> str:
    return f"in an impact at {worst[0] / KMH:.0f} km/h" if worst[0] > 0.0 else f"{-worst[1]:.1f} m before contact"


def _charts(manoeuvre: Manoeuvre, done: list[tuple[BrakingCase, DriveRecord]]) -> tuple[Chart, Chart]:
    first = [(case, drive) for case, drive in done if case.manoeuvre == manoeuvre and case.seed == 0]

    def lines(values: str, scale: float) -> tuple[Series, ...]:
        return tuple(
            Series(
                _label(case),
                drive.t_s,
                tuple(value * scale for value in getattr(drive, values)),
            )
            for case, drive in first
        )

    return (
        Chart(f"{manoeuvre}: speed", "time s", "speed km/h", lines("speed_mps", 1.0 / KMH)),
        Chart(f"{manoeuvre}: gap", "time s", "gap m", lines("gap_m", 1.0)),
    )


BRAKING = Experiment("braking", "paper", "Braking: CCRs, CCRm and CCRb", cases, run, report, as_drive)
