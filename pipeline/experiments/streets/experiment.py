"""Experiment: is the CIPV right in streets without paint and route, and what do the road's edges and other vehicles
contribute?

Bends of 30–150 m radius between parked rows, hedges and kerbs; a car drives ahead, or nothing does. At corners, nothing
does. Every frame goes
through the pipeline as it is by default, without the road's edges, and without other vehicles either. Detections are
given, and the truth is that of ``curves``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.evaluation.report_sections import Cell, ReportSection, Table
from pipeline.experiments.curves.drives import BOXES, SourceFrames, driven
from pipeline.experiments.curves.experiment import longest_wrong_s, share_right
from pipeline.experiments.experiment import Experiment, ExperimentDrive
from pipeline.experiments.streets import scenarios
from pipeline.experiments.streets.scenarios import BESIDE, CORNER_M, REACH_M, SPEEDS_KMH, Street
from pipeline.params import Params, with_changes
from pipeline.simulation.sensors.detection_model import Detections

NEITHER, WITHOUT, WITH = "yaw rate", "with vehicles", "with vehicles and edges"
SETTINGS = {
    WITH: {"path.use_gnss": False, "path.use_traffic": True, "path.use_edges": True},
    WITHOUT: {"path.use_gnss": False, "path.use_traffic": True, "path.use_edges": False},
    NEITHER: {"path.use_gnss": False, "path.use_traffic": False, "path.use_edges": False},
}


@dataclass(frozen=True)
class StreetCase:
    """One drive through a street."""

    street: Street
    """The street: bends, borders and traffic."""
    seed: int
    """Seed of noise and scenery."""


StreetOutcome = dict[str, SourceFrames]


def cases(short: bool) -> list[StreetCase]:
    """Every street; every second one bends to the left first."""
    if short:
        return [StreetCase(Street(50.0, "hedges", "lead"), 0)]
    bends = [r for r in SPEEDS_KMH if r != CORNER_M]
    streets = [Street(r, beside, ahead) for r in bends for beside in BESIDE for ahead in ("lead", "nothing")]
    corners = [StreetCase(Street(CORNER_M, beside, "nothing"), seed) for beside in BESIDE for seed in (0, 1)]
    return [*(StreetCase(street, n % 2) for n, street in enumerate(streets)), *corners]


def run(case: StreetCase) -> StreetOutcome:
    scene = scenarios.scenario(case.street, case.seed)
    return driven(scene, REACH_M, tuple(SETTINGS), settings=SETTINGS, lines=None)


def as_drive(case: StreetCase, outcome: StreetOutcome) -> ExperimentDrive:
    """The drive with the road's edges."""
    share, frames = share_right([outcome[WITH]])
    street = case.street
    return ExperimentDrive(
        f"street_{street.radius_m:.0f}_{street.beside}_{street.ahead}_{case.seed}",
        f"{street.title}, run {case.seed}",
        (f"Correct in {100.0 * share:.1f} % of {frames} decidable frames.",),
        scenarios.scenario(street, case.seed),
        with_changes(Params(), SETTINGS[WITH]),
        "both",
        (),
        Detections(boxes=BOXES),
    )


def report(cases: Sequence[StreetCase], outcomes: Sequence[StreetOutcome]) -> ReportSection:
    """The report, by kind of border and in total."""
    return ReportSection(
        "streets",
        "Streets without lane markings and without a route",
        (
            "Detections are given and the VLP-16 is simulated as in the curves. Speed and yaw rate come from the car's "
            f"bus; leads count up to {REACH_M:.0f} m. With nothing ahead, a frame is right if no lead is chosen. "
            f"Corners have a radius of {CORNER_M:.0f} m and are taken at {SPEEDS_KMH[CORNER_M]:.0f} km/h.",
        ),
        (
            Table(
                "CIPV correct, % of decidable frames",
                ("beside the road", "ahead", "path", "right, %", "frames", "longest wrong, s", "path error at 30 m, m"),
                tuple(_rows(cases, outcomes)),
                decimals=2,
            ),
        ),
    )


def _rows(cases: Sequence[StreetCase], outcomes: Sequence[StreetOutcome]) -> Iterator[tuple[Cell, ...]]:
    groups = sorted({_group(case) for case in cases})
    for name in (NEITHER, WITHOUT, WITH):
        for beside, ahead in groups:
            chosen = [
                outcome[name] for case, outcome in zip(cases, outcomes, strict=True) if _group(case) == (beside, ahead)
            ]
            yield (beside, ahead, name, *_figures(chosen))
        yield ("all", "all", name, *_figures([outcome[name] for outcome in outcomes]))


def _group(case: StreetCase) -> tuple[str, str]:
    """What is beside the street, and what is ahead."""
    street = case.street
    return street.beside, street.ahead if street.radius_m != CORNER_M else "nothing, at a corner"


def _figures(drives: Sequence[SourceFrames]) -> tuple[Cell, ...]:
    share, frames = share_right(drives)
    errors = np.abs([row[1] for drive in drives for row in drive.errors_m])
    return 100.0 * share, frames, max(longest_wrong_s(drive) for drive in drives), float(np.nanmean(errors))


STREETS = Experiment("streets", "streets", "Streets", cases, run, report, as_drive)
