"""Position and speed errors by range and by sensor, in the form of the paper's Table 4 (smallest, largest, mean), and
the calibration of the sigmas that the pipeline gives with its distances."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pipeline.evaluation.report_sections import Cell, Chart, ReportSection, Series, Table
from pipeline.evaluation.scores.figures import Drives
from pipeline.evaluation.scores.matching import MAX_RANGE_M, Error
from pipeline.types import most_sensors_first

BIN_M = 10
_ERRORS = ("distance_m", "lateral_m", "longitudinal_m", "speed_mps")
COLUMNS = (
    *("vehicles", "seen by", "count"),
    *(
        f"{what} {which}"
        for what in ("distance", "lateral", "longitudinal", "speed")
        for which in ("min", "max", "MAE")
    ),
)

SIGMA_BIN_M = 20
_SIGMAS = (1, 2, 3)
SIGMA_COLUMNS = ("vehicles", "seen by", "count", *(f"within {k} σ" for k in _SIGMAS))


def _all_errors(run: Drives) -> list[Error]:
    return [error for drive in run for frame in drive.frames for error in frame.errors]


def errors_section(run: Drives) -> ReportSection:
    """A table and a chart of each error."""
    every = _all_errors(run)
    return ReportSection(
        "errors",
        "Errors by range and sensor",
        (
            "Absolute errors: smallest, largest, mean. Distance: to the nearest point. Lateral and longitudinal: of "
            "the middle of the nearest face. Speed: relative to ego, along the car's axis, against the motion that "
            "neighbouring labelled frames show.",
        ),
        (
            Table("Errors, m and m/s", COLUMNS, error_rows(run), decimals=3),
            Table(
                "Distance errors within the σ given with them, %",
                SIGMA_COLUMNS,
                sigma_rows(run),
                caption="Normal errors: 68, 95 and 99.7 %. A smaller share means that the pipeline is overconfident.",
                decimals=0,
            ),
        ),
        tuple(_scatter(title, unit, name, every) for name, (title, unit) in _CHARTS.items()),
    )


_CHARTS = {
    "distance_m": ("Distance error over range", "m"),
    "lateral_m": ("Lateral error over range", "m"),
    "longitudinal_m": ("Longitudinal error over range", "m"),
    "speed_mps": ("Speed error over range", "m/s"),
}


def _scatter(title: str, unit: str, name: str, errors: Sequence[Error]) -> Chart:
    """One error of every vehicle in every frame, by sensor."""
    lines = []
    for source in most_sensors_first():
        pairs = [(e.range_m, value) for e in errors if e.source == source and (value := getattr(e, name)) is not None]
        lines.append(Series.of_points(source, pairs))
    return Chart(title, "true range m", f"estimated − true {unit}", tuple(lines))


def error_rows(run: Drives) -> tuple[tuple[Cell, ...], ...]:
    """By sensor over all ranges, then for each range bin in total and by sensor. Empty groups are omitted."""
    every = _all_errors(run)
    groups: list[tuple[str, str, list[Error]]] = [("all", "any", every)]
    groups += [("all", source, [e for e in every if e.source == source]) for source in most_sensors_first()]
    for low in range(0, int(MAX_RANGE_M), BIN_M):
        inside = [error for error in every if low <= error.range_m < low + BIN_M]
        name = f"{low}–{low + BIN_M} m"
        groups.append((name, "any", inside))
        groups += [(name, source, [e for e in inside if e.source == source]) for source in most_sensors_first()]
    return tuple((name, source, len(errors), *_table_4(errors)) for name, source, errors in groups if errors)


def sigma_rows(run: Drives) -> tuple[tuple[Cell, ...], ...]:
    """The share of distance errors within 1, 2 and 3 of their sigmas, in %: by sensor over all ranges, then by range
    and sensor. Empty groups are omitted."""
    every = [error for error in _all_errors(run) if error.distance_sigma_m]
    groups = [("all", source, [e for e in every if e.source == source]) for source in most_sensors_first()]
    for low in range(0, int(MAX_RANGE_M), SIGMA_BIN_M):
        inside = [error for error in every if low <= error.range_m < low + SIGMA_BIN_M]
        name = f"{low}–{low + SIGMA_BIN_M} m"
        groups += [(name, source, [e for e in inside if e.source == source]) for source in most_sensors_first()]
    return tuple((name, source, len(errors), *_within(errors)) for name, source, errors in groups if errors)


def _within(errors: Sequence[Error]) -> tuple[float, ...]:
    away = [abs(error.distance_m) / (error.distance_sigma_m or 1.0) for error in errors]
    return tuple(100.0 * sum(each <= k for each in away) / len(away) for k in _SIGMAS)


def _table_4(errors: Iterable[Error]) -> tuple[float | None, ...]:
    """Min, max and MAE of each error (paper, Table 4)."""
    rows = list(errors)
    figures: list[float | None] = []
    for name in _ERRORS:
        sizes = [abs(value) for error in rows if (value := getattr(error, name)) is not None]
        figures += [min(sizes), max(sizes), sum(sizes) / len(sizes)] if sizes else [None, None, None]
    return tuple(figures)
