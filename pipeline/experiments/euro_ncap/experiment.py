"""Experiment: the car-to-car rear grid of Euro NCAP, and UN Regulation 152 beside it.

CCRs: 10–80 km/h towards a standing car. CCRm: 30–80 km/h towards one that drives 20 km/h. Both in steps of 5 km/h, at
five overlaps. CCRb: both at 50 km/h, 12 or 40 m apart, the lead brakes at 2 or 6 m/s². Impact speeds are relative, in
the colours of Euro NCAP's protocol of 2026 (``ncap_limits``). As in a real test, a robot holds the speed until AEB
acts; a run whose approach leaves the protocol's tolerance is void.
"""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.evaluation.report_sections import Cell, Coloured, ReportSection, Scene, Table, Tone
from pipeline.experiments.euro_ncap.drives import (
    OVERLAPS,
    RUN_UP_S,
    START_TTC_S,
    CellResult,
    EuroNcapCase,
    NcapTest,
    SensorSetup,
    as_drive,
    cases,
    kind_said,
    run,
    scenario,
)
from pipeline.experiments.euro_ncap.limits import impact_tone, r152_limit_kmh
from pipeline.experiments.experiment import Experiment
from pipeline.experiments.perception import SENSORS
from pipeline.experiments.straight_track import KMH


def report(cases: Sequence[EuroNcapCase], results: Sequence[CellResult]) -> ReportSection:
    done = dict(zip(cases, results, strict=True))
    kinds = list(dict.fromkeys(case.kind for case in cases))
    tables = [_summary(kinds, done), _r152(done)]
    for kind in kinds:
        mine = {case: result for case, result in done.items() if case.kind == kind}
        tables += [_grid(test, kind_said(kind), mine) for test in ("CCRs", "CCRm")]
        tables.append(_braked(kind_said(kind), mine))
    return ReportSection(
        "ncap",
        "Euro NCAP car-to-car rear grid",
        (
            f"Every run starts {RUN_UP_S:g} s before TTC {START_TTC_S:g} s with the speed held. The camera's boxes "
            "are projected ground truth with a detector's errors; in a sample of the cells (network), those of the "
            "embedded network on rendered images. AEB: a robot holds the speed and only AEB brakes. ACC: the "
            "paper's speed law alone, set to the test speed. Cells are relative impact speeds in km/h; 0 is avoided. "
            "Colours are those of Euro NCAP's protocol of 2026, whose bands depend on the test speed: green avoided, "
            "then yellow, orange, brown, red. Grey: the approach did not meet the protocol.",
            _verdict(done),
        ),
        tuple(tables),
        scenes=tuple(
            Scene(f"{case.test}, {case.at}", scenario(case), RUN_UP_S + 2.0)
            for case in {case.test: case for case in done}.values()
        ),
    )


def _summary(kinds: list[SensorSetup], done: dict[EuroNcapCase, CellResult]) -> Table:
    rows: list[tuple[Cell, ...]] = []
    for kind in kinds:
        for test in ("CCRs", "CCRm", "CCRb"):
            valid = [
                result for case, result in done.items() if (case.kind, case.test) == (kind, test) and not result.void
            ]
            avoided = sum(result.impact_kmh == 0.0 for result in valid)
            mean = sum(result.impact_kmh for result in valid) / len(valid) if valid else None
            worst = max((result.impact_kmh for result in valid), default=None)
            rows.append((SENSORS[kind[0]], kind[1], kind[2], test, len(valid), avoided, mean, worst))
    columns = ("sensors", "controller", "boxes", "test", "valid runs", "avoided", "mean impact km/h", "worst km/h")
    return Table("Contribution of each sensor", columns, tuple(rows), decimals=1)


def _grid(test: NcapTest, name: str, done: dict[EuroNcapCase, CellResult]) -> Table:
    mine = {(case.speed_kmh, case.overlap): (case, result) for case, result in done.items() if case.test == test}
    overlaps = [overlap for overlap in OVERLAPS if any(key[1] == overlap for key in mine)]
    rows = tuple(
        (f"{speed:.0f} km/h", *(_cell(mine.get((speed, overlap))) for overlap in overlaps))
        for speed in sorted({speed for speed, _ in mine})
    )
    return Table(f"{test}: {name}", ("speed", *(f"{overlap} %" for overlap in overlaps)), rows, decimals=0)


def _braked(name: str, done: dict[EuroNcapCase, CellResult]) -> Table:
    mine = {(case.decel_mps2, case.gap_m): (case, result) for case, result in done.items() if case.test == "CCRb"}
    gaps = sorted({gap for _, gap in mine})
    rows = tuple(
        (f"−{decel:.0f} m/s²", *(_cell(mine.get((decel, gap))) for gap in gaps))
        for decel in sorted({decel for decel, _ in mine})
    )
    return Table(f"CCRb at 50 km/h: {name}", ("lead brakes", *(f"{gap:.0f} m" for gap in gaps)), rows, decimals=0)


def _cell(found: tuple[EuroNcapCase, CellResult] | None) -> Cell | Coloured:
    if found is None:
        return None
    case, result = found
    tone: Tone = "grey" if result.void else impact_tone(case.speed_kmh, result.impact_kmh)
    return Coloured(result.void or result.impact_kmh, tone, case.name)


def _r152(done: dict[EuroNcapCase, CellResult]) -> Table:
    """Standing and moving targets at full overlap with AEB alone, compared with the Regulation's limits."""
    rows: list[tuple[Cell | Coloured, ...]] = []
    for test in ("CCRs", "CCRm"):
        for closing in sorted({round(case.closing_mps() / KMH) for case in done if case.test == test}):
            limit = r152_limit_kmh(closing)
            if limit is None:
                continue
            cells = [
                _passes(case, result, limit)
                for sensors in ("both", "lidar")
                for case, result in done.items()
                if (case.test, case.kind, case.overlap) == (test, (sensors, "AEB", "truth"), 100)
                and round(case.closing_mps() / KMH) == closing
            ]
            rows.append((test, f"{closing} km/h", limit, *cells))
    columns = ("test", "relative speed", "limit km/h", "fused km/h", "LiDAR km/h")
    caption = "UN R152, M1 unladen: green within the limit, red beyond it."
    return Table("UN R152: largest relative impact speed", columns, tuple(rows), caption, 0)


def _passes(case: EuroNcapCase, result: CellResult, limit_kmh: float) -> Coloured:
    return Coloured(result.impact_kmh, "green" if result.impact_kmh <= limit_kmh else "red", case.name)


def _verdict(done: dict[EuroNcapCase, CellResult]) -> str:
    """A sentence for AEB alone: in how many cells the impact is slower with both sensors than with the LiDAR alone, and
    in how many it is faster."""
    pairs = [
        (result, done[other])
        for case, result in done.items()
        if case.kind == ("both", "AEB", "truth")
        and (
            other := EuroNcapCase(case.test, case.speed_kmh, case.overlap, "lidar", "AEB", case.gap_m, case.decel_mps2)
        )
        in done
    ]
    counted = [(fused.impact_kmh, lidar.impact_kmh) for fused, lidar in pairs if not fused.void and not lidar.void]
    better = sum(fused < lidar - 1.0 for fused, lidar in counted)
    worse = sum(fused > lidar + 1.0 for fused, lidar in counted)
    return (
        f"With AEB alone, of {len(counted)} runs fused ends slower than the LiDAR alone in {better}, faster in {worse} "
        f"and the same (within 1 km/h) in {len(counted) - better - worse}."
    )


NCAP = Experiment("ncap", "euroncap", "Euro NCAP car-to-car rear grid", cases, run, report, as_drive)
