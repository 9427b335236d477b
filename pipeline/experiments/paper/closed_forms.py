"""The constant decelerations that the paper reports for its braking manoeuvres (section AEB test), as printed and as
physically correct."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pipeline.evaluation.report_sections import Table
from pipeline.experiments.straight_track import KMH

Manoeuvre = Literal["CCRs", "CCRm", "CCRb"]
LEAD_DECEL_MPS2 = 6.0


@dataclass(frozen=True)
class Printed:
    """A manoeuvre as computed in the paper."""

    speed_kmh: float
    """Speed before braking."""
    end_kmh: float
    """Speed after braking."""
    keep_m: float
    """The gap that remains."""
    lidar_m: float
    """Detection range of the LiDAR alone."""
    fused_m: float
    """Detection range of both sensors."""
    lidar_mps2: float
    """Deceleration printed for the LiDAR alone."""
    fused_mps2: float
    """Deceleration printed for both sensors."""


PAPER: dict[Manoeuvre, Printed] = {
    "CCRs": Printed(100.0, 0.0, 10.0, 30.0, 60.0, 19.29, 7.72),
    "CCRm": Printed(50.0, 20.0, 20.0, 35.0, 60.0, 5.401, 2.025),
    "CCRb": Printed(50.0, 0.0, 10.0, 30.0, 50.0, 4.823, 2.411),
}


def printed_decel_mps2(speed_mps: float, end_mps: float, detected_m: float, keep_m: float) -> float:
    """The paper's formula: (v² − v₀²) / (2·(d − d_keep)). It assumes a standing lead."""
    return (speed_mps**2 - end_mps**2) / (2.0 * (detected_m - keep_m))


def needed_decel_mps2(closing_mps: float, detected_m: float, keep_m: float) -> float:
    """Physics for a lead at constant speed: Δv² / (2·(d − d_keep)), in the lead's own frame."""
    return closing_mps**2 / (2.0 * (detected_m - keep_m))


def needed_behind_braking_mps2(
    speed_mps: float, lead_mps: float, lead_decel_mps2: float, gap_m: float, keep_m: float
) -> float:
    """Physics for a lead that brakes to standstill: its own stopping distance adds to the gap."""
    return speed_mps**2 / (2.0 * (gap_m + lead_mps**2 / (2.0 * lead_decel_mps2) - keep_m))


def closed_forms() -> Table:
    """The printed decelerations, the printed formula, and the correct physics."""
    rows = []
    for manoeuvre, paper in PAPER.items():
        speed, end = paper.speed_kmh * KMH, paper.end_kmh * KMH
        for name, detected, value in (
            ("LiDAR", paper.lidar_m, paper.lidar_mps2),
            ("fused", paper.fused_m, paper.fused_mps2),
        ):
            formula = printed_decel_mps2(speed, end, detected, paper.keep_m)
            physics = (
                needed_behind_braking_mps2(speed, speed, LEAD_DECEL_MPS2, detected, paper.keep_m)
                if manoeuvre == "CCRb"
                else needed_decel_mps2(speed - end, detected, paper.keep_m)
            )
            rows.append((manoeuvre, name, detected, paper.keep_m, value, formula, physics))
    return Table(
        "Constant deceleration needed from the paper's detection ranges, m/s²",
        ("manoeuvre", "sensors", "detected at m", "gap kept m", "printed", "printed formula", "physics"),
        tuple(rows),
        "The printed formula assumes a standing lead. Physics: CCRm closes at 30 km/h only; in CCRb the lead's own "
        f"stopping distance (at {LEAD_DECEL_MPS2:g} m/s²) adds to the gap.",
        3,
    )
