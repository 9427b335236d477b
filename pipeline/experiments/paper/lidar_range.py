"""Experiment: how far the LiDAR detects a car, and how accurate its distance is (paper, LiDAR range check).

The car stands; the ego vehicle drives up to it from 100 m at 36 km/h. The paper measures 2.14 % mean error, 0.47 m at
most, and recognition up to 35 m, with RTK GNSS as truth. Here truth is the simulator's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.evaluation.report_sections import Chart, ReportSection, Scene, Series, Table
from pipeline.experiments.experiment import Experiment, ExperimentDrive
from pipeline.experiments.straight_track import parameters, scene, target_of, true_range_m
from pipeline.simulation.closed_loop import LoopStep, Setup, drive
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.world.actors import ActorKind

PRINTED = {"mean error %": 2.14, "largest error m": 0.47, "recognised up to m": 35.0}
_SPEED_MPS = 10.0
_FROM_M, _TO_M = 100.0, 4.0
_PARAMS = parameters("ACC", _SPEED_MPS)
_BIN_M = 5.0
_BESIDE_M = 1.5
_RECOGNISED = 0.5
_SHOWN_AT_S = 8.0
COLOURS = ("#a3202a", "#e8e8e6", "#15181c", "#5b6f86")


@dataclass(frozen=True)
class RangeCase:
    """One approach to a standing vehicle."""

    kind: ActorKind
    """Kind of the standing vehicle; larger ones are detected farther away."""
    seed: int
    """Seed of noise and scenery."""


@dataclass(frozen=True)
class RangeSample:
    """One tick."""

    true_m: float
    """True distance of the car."""
    measured_m: float | None
    """Measured distance; None if the car was not detected in this sweep."""


def cases(short: bool) -> list[RangeCase]:
    kinds: tuple[ActorKind, ...] = ("car",) if short else ("car", "van", "truck", "motorcycle")
    return [RangeCase(kind, seed) for kind in kinds for seed in range(2 if short else 10)]


def run(case: RangeCase) -> list[RangeSample]:
    setup = Setup(_PARAMS, "lidar", closed=False)
    return [RangeSample(true_range_m(target_of(tick)), _measured_m(tick)) for tick in drive(_scenario(case), setup)]


def _scenario(case: RangeCase) -> Scenario:
    target = {
        "kind": case.kind,
        "colour": COLOURS[case.seed % len(COLOURS)],
        "ahead_m": _FROM_M,
        "speed_mps": {0.0: 0.0},
    }
    duration_s = (_FROM_M - _TO_M) / _SPEED_MPS
    return scene({0.0: _SPEED_MPS}, target, duration_s, case.seed)


def as_drive(case: RangeCase, seen: list[RangeSample]) -> ExperimentDrive:
    """The drive of one run."""
    errors = [abs(each.measured_m - each.true_m) for each in seen if each.measured_m is not None]
    largest = f"; largest error {max(errors):.2f} m" if errors else ""
    return ExperimentDrive(
        f"ranging_{case.kind}_{case.seed}",
        f"LiDAR range check: {case.kind}, run {case.seed}",
        (f"Detected in {len(errors)} of {len(seen)} sweeps{largest}.",),
        _scenario(case),
        _PARAMS,
        "lidar",
        (Chart("Distance error", "true range m", "error m", (_errors(case.kind, seen),)),),
    )


def _measured_m(tick: LoopStep) -> float | None:
    """Distance of the nearest object in the car's lane, whatever its error, since nothing else stands there. Carried
    objects do not count."""
    ahead = [
        item.distance_m
        for item in tick.result.objects
        if not item.carried
        and item.distance_m is not None
        and item.closest_point is not None
        and abs(item.closest_point[1]) < _BESIDE_M
    ]
    return min(ahead, default=None)


def recognised_to_m(sightings: Sequence[RangeSample]) -> float | None:
    """The far edge of the last 5 m bin, from near to far, in which the car is detected in at least half of the
    sweeps."""
    reached = None
    edge = _BIN_M
    while edge < _FROM_M:
        inside = [each.measured_m is not None for each in sightings if edge <= each.true_m < edge + _BIN_M]
        if not inside or sum(inside) < _RECOGNISED * len(inside):
            break
        edge += _BIN_M
        reached = edge
    return reached


def report(cases: Sequence[RangeCase], runs: Sequence[list[RangeSample]]) -> ReportSection:
    kinds = list(dict.fromkeys(case.kind for case in cases))
    by_kind = {
        kind: [each for case, run in zip(cases, runs, strict=True) if case.kind == kind for each in run]
        for kind in kinds
    }
    return ReportSection(
        "ranging",
        "LiDAR range check",
        (
            "A standing vehicle from 100 m to 4 m, one LiDAR, no camera. Recognised up to: in this 5 m bin and in all "
            "nearer ones, the vehicle is detected in at least half of the sweeps. Errors are those of the nearest "
            "object in its lane, however large, in all sweeps with a detection.",
            "No comparison with both sensors, since there is no camera here. Within this range, a fused distance is "
            "that of the LiDAR; the following experiments show what the camera adds beyond it.",
        ),
        (Table("Range and error", _COLUMNS, (_PRINTED_ROW, *(_row(kind, seen) for kind, seen in by_kind.items()))),),
        (
            Chart(
                "Share of sweeps in which the vehicle is detected",
                "true range m",
                "share",
                tuple(_rate(kind, seen) for kind, seen in by_kind.items()),
            ),
            Chart(
                "Distance error",
                "true range m",
                "error m",
                tuple(_errors(kind, seen) for kind, seen in by_kind.items()),
            ),
        ),
        scenes=tuple(Scene(f"A standing {kind}", _scenario(RangeCase(kind, 0)), _SHOWN_AT_S) for kind in kinds),
    )


_COLUMNS = ("target", "mean error %", "mean error m", "largest error m", "recognised up to m", "first seen at m")
_PRINTED_ROW = (
    "car (paper)",
    PRINTED["mean error %"],
    None,
    PRINTED["largest error m"],
    PRINTED["recognised up to m"],
    None,
)


def _row(kind: str, seen: list[RangeSample]) -> tuple[str | float | None, ...]:
    held = [(abs(each.measured_m - each.true_m), each.true_m) for each in seen if each.measured_m is not None]
    if not held:
        return (kind, None, None, None, None, None)
    return (
        kind,
        100.0 * sum(error / true for error, true in held) / len(held),
        sum(error for error, _ in held) / len(held),
        max(error for error, _ in held),
        recognised_to_m(seen),
        max(true for _, true in held),
    )


def _rate(kind: str, seen: list[RangeSample]) -> Series:
    edges = [n * _BIN_M for n in range(1, round(_FROM_M / _BIN_M))]
    bins = [
        (edge, [each.measured_m is not None for each in seen if edge <= each.true_m < edge + _BIN_M]) for edge in edges
    ]
    filled = [(edge + _BIN_M / 2, sum(held) / len(held)) for edge, held in bins if held]
    return Series(kind, tuple(x for x, _ in filled), tuple(y for _, y in filled))


def _errors(kind: str, seen: list[RangeSample]) -> Series:
    return Series.of_points(
        kind, ((each.true_m, each.measured_m - each.true_m) for each in seen if each.measured_m is not None)
    )


RANGING = Experiment("ranging", "paper", "LiDAR range check", cases, run, report, as_drive)
