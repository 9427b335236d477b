"""The drives of the car-to-car rear grid: every cell, its approach, and whether it met the protocol."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from pipeline.experiments.experiment import ExperimentDrive
from pipeline.experiments.perception import SENSORS, Boxes, boxes_said, detections_for, eyes_for
from pipeline.experiments.straight_track import KMH, DriveRecord, approach, drive_charts, parameters, scene
from pipeline.params import Params
from pipeline.run import Sensors
from pipeline.simulation.closed_loop import Setup
from pipeline.simulation.drive_as_scenario import as_driven
from pipeline.simulation.scenario import Scenario

NcapTest = Literal["CCRs", "CCRm", "CCRb"]
OVERLAPS = (-50, -75, 100, 75, 50)
"""Overlap: share of the ego vehicle's width that would hit the target, %. Negative: the target is to the left."""
EGO_WIDTH_M = 1.82
MOVING_KMH = 20.0
BRAKED_KMH = 50.0
START_TTC_S = 4.0
RUN_UP_S = 1.5
SPEED_TOLERANCE_MPS = 1.0 * KMH
SensorSetup = tuple[Sensors, str, Boxes]
SETUPS: tuple[SensorSetup, ...] = (
    ("both", "AEB", "truth"),
    ("lidar", "AEB", "truth"),
    ("both", "ACC", "truth"),
    ("lidar", "ACC", "truth"),
    ("both", "ACC + AEB", "truth"),
)
NETWORK: SensorSetup = ("both", "AEB", "network")
NETWORK_SAMPLE: tuple[tuple[NcapTest, float, int], ...] = (
    *(("CCRs", speed, 100) for speed in (20.0, 40.0, 60.0, 80.0)),
    *(("CCRs", 40.0, overlap) for overlap in (-50, 50)),
    *(("CCRm", speed, 100) for speed in (40.0, 60.0, 80.0)),
)
"""Cells that are also driven with the embedded network on rendered images. So is the lead that brakes at 6 m/s² from 40
m ahead."""


def kind_said(kind: SensorSetup) -> str:
    sensors, controller, boxes = kind
    return f"{SENSORS[sensors]}, {controller}{boxes_said(boxes)}"


@dataclass(frozen=True)
class EuroNcapCase:
    """One cell of the grid, driven once."""

    test: NcapTest
    """Standing, moving or braking target."""
    speed_kmh: float
    """Speed of the ego vehicle."""
    overlap: int
    """Share of the ego vehicle's width that would hit the target, %. Negative: the target is to the left."""
    sensors: Sensors
    """Sensors that the pipeline gets."""
    controller: str
    """``ACC`` or ``ACC + AEB``."""
    gap_m: float = 0.0
    """CCRb only: gap when the target begins to brake."""
    decel_mps2: float = 0.0
    """CCRb only: deceleration of the target."""
    boxes: Boxes = "truth"
    """Source of the camera's boxes."""

    @property
    def kind(self) -> SensorSetup:
        return self.sensors, self.controller, self.boxes

    @property
    def name(self) -> str:
        """Name for use in file names."""
        what = f"gap{self.gap_m:.0f}_brake{self.decel_mps2:.0f}" if self.test == "CCRb" else f"overlap{self.overlap}"
        kind = "_".join((SENSORS[self.sensors], self.controller.replace(" + ", "+"), self.boxes))
        return f"{self.test}_{self.speed_kmh:.0f}kmh_{what}_{kind}".lower()

    @property
    def at(self) -> str:
        """Position in the grid of its test, as text."""
        at = f"{self.gap_m:.0f} m, −{self.decel_mps2:.0f} m/s²" if self.test == "CCRb" else f"overlap {self.overlap} %"
        return f"{self.speed_kmh:.0f} km/h, {at}"

    def closing_mps(self) -> float:
        return (self.speed_kmh - (MOVING_KMH if self.test == "CCRm" else 0.0)) * KMH


@dataclass(frozen=True)
class CellResult:
    """Outcome of a cell."""

    impact_kmh: float
    """Relative impact speed; 0 if the collision was avoided."""
    void: str
    """Reason why the run is not valid; empty if it is."""
    drive: DriveRecord | None = field(default=None, compare=False)
    """The run itself; None if only its figures were kept."""


def cases(short: bool) -> list[EuroNcapCase]:
    speeds = {"CCRs": range(10, 81, 5), "CCRm": range(30, 81, 5)} if not short else {"CCRs": (30, 60), "CCRm": (50,)}
    overlaps = (-50, 100) if short else OVERLAPS
    found = []
    for sensors, controller, _ in SETUPS[:2] if short else SETUPS:
        grid: list[tuple[NcapTest, float, int]] = [
            (test, float(speed), overlap) for test in ("CCRs", "CCRm") for speed in speeds[test] for overlap in overlaps
        ]
        found += [EuroNcapCase(test, speed, overlap, sensors, controller) for test, speed, overlap in grid]
        found += [
            EuroNcapCase("CCRb", BRAKED_KMH, 100, sensors, controller, gap, decel)
            for decel in (2.0, 6.0)
            for gap in (12.0, 40.0)
            if not short or (decel, gap) == (6.0, 40.0)
        ]
    if short:
        return found
    sensors, controller, boxes = NETWORK
    sample = [EuroNcapCase(*each, sensors, controller, boxes=boxes) for each in NETWORK_SAMPLE]
    return [*found, *sample, EuroNcapCase("CCRb", BRAKED_KMH, 100, sensors, controller, 40.0, 6.0, boxes)]


def run(case: EuroNcapCase) -> CellResult:
    """Drive one approach."""
    drive = approach(scenario(case), Setup(_params(case), case.sensors, eyes_for(case.boxes)))
    return CellResult((drive.impact_mps or 0.0) / KMH, _void(case, drive), drive)


def _params(case: EuroNcapCase) -> Params:
    return parameters(case.controller, case.speed_kmh * KMH)


def scenario(case: EuroNcapCase) -> Scenario:
    speed = case.speed_kmh * KMH
    aside = (1.0 - abs(case.overlap) / 100.0) * EGO_WIDTH_M * (1.0 if case.overlap < 0 else -1.0)
    target: dict[str, object] = {"offset_m": aside, "colour": "#8e9aa3"}
    if case.test == "CCRb":
        target |= {
            "ahead_m": case.gap_m,
            "speed_mps": {0.0: speed},
            "brake": {"at_s": RUN_UP_S, "decel_mps2": case.decel_mps2},
        }
    else:
        target |= {
            "ahead_m": case.closing_mps() * (START_TTC_S + RUN_UP_S),
            "speed_mps": {0.0: MOVING_KMH * KMH if case.test == "CCRm" else 0.0},
        }
    return scene({0.0: speed}, target, RUN_UP_S + 14.0, seed=0)


def as_drive(case: EuroNcapCase, result: CellResult) -> ExperimentDrive:
    """The drive of one cell."""
    assert result.drive is not None
    ended = f"Impact at {result.impact_kmh:.0f} km/h." if result.impact_kmh else "The impact was avoided."
    title = f"{case.test}, {case.at}: {kind_said(case.kind)}"
    return ExperimentDrive(
        case.name,
        title,
        (f"Void: {result.void}." if result.void else ended,),
        as_driven(scenario(case), result.drive.motions, title),
        _params(case),
        case.sensors,
        drive_charts(result.drive),
        detections_for(case.boxes),
    )


def _void(case: EuroNcapCase, drive: DriveRecord) -> str:
    """Why the approach violated the protocol; empty if it did not. From the start of the test until the car brakes by
    itself, the speed must stay within 0 to +1 km/h, and the car must not brake before the start."""
    wanted = case.speed_kmh * KMH
    for t_s, speed, state, accel in zip(drive.t_s, drive.speed_mps, drive.states, drive.accel_mps2, strict=True):
        acts = accel < -0.5 or state in ("partial_brake", "full_brake")
        if t_s < RUN_UP_S and acts:
            return "braked before the start"
        if acts:
            return ""
        if t_s >= RUN_UP_S and not -0.01 <= speed - wanted <= SPEED_TOLERANCE_MPS:
            return f"speed off by {(speed - wanted) / KMH:.1f} km/h"
    return ""
