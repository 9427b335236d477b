"""The figures of a run, each declared once: its name, which direction is better, what a drive contributes and how the
contributions combine; with confidence intervals by bootstrap over drives.

A figure of several drives weights each by how much of it was scored. Frames of one drive depend on one another, so only
whole drives are resampled (Efron's percentile bootstrap); a single drive has no interval.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from pipeline.evaluation.scores.alarms import Alarm, AlarmKind
from pipeline.evaluation.scores.drive import DriveScore
from pipeline.evaluation.scores.tracking import Counts, hota_of, idf1_sums, mota_sums, precision_sums, recall_sums

Sums = tuple[float, float]
"""Contribution of a drive to numerator and denominator."""
Drives = Sequence[DriveScore]
RESAMPLES, CONFIDENCE, SEED = 1000, 0.95, 0


def ratio(parts: Sequence[Sums]) -> float | None:
    """Ratio of the sums over drives; None if the denominator is zero."""
    over, under = sum(part[0] for part in parts), sum(part[1] for part in parts)
    return over / under if under else None


@dataclass(frozen=True)
class Figure:
    """One score: its name, and how it is computed over drives."""

    name: str
    """For scripts."""
    title: str
    """For reports."""
    unit: str
    """Empty for counts and shares."""
    better: Literal["higher", "lower"]
    """Which direction is an improvement."""
    part: Callable[[DriveScore], Any]
    """The contribution of one drive."""
    whole: Callable[[Sequence[Any]], float | None] = ratio
    """The score from the contributions of all drives; None where it is undefined."""

    def of(self, drives: Drives) -> float | None:
        return self.whole([self.part(drive) for drive in drives])


@dataclass(frozen=True)
class Interval:
    """A 95 % confidence interval from resampling drives."""

    low: float
    """2.5th percentile."""
    high: float
    """97.5th percentile."""


@dataclass(frozen=True)
class MeasuredFigure:
    """The value of a figure."""

    figure: Figure
    """What was measured."""
    value: float | None
    """None where it is undefined."""
    interval: Interval | None
    """95 % confidence interval; None where fewer than two drives have the figure."""


@dataclass(frozen=True)
class Compared:
    """A figure of two runs over the same drives."""

    figure: Figure
    """What was compared."""
    base: float | None
    """Of the run compared with; None where it is undefined."""
    run: float | None
    """Of the run itself; None where it is undefined."""
    interval: Interval | None
    """95 % confidence interval of run minus base, from drives resampled in pairs."""

    @property
    def difference(self) -> float | None:
        return None if self.base is None or self.run is None else self.run - self.base


def measure(drives: Drives) -> tuple[MeasuredFigure, ...]:
    """Every figure of one run."""
    measured = []
    for figure in FIGURES:
        parts = [figure.part(drive) for drive in drives]
        measured.append(MeasuredFigure(figure, figure.whole(parts), bootstrap(parts, figure.whole)))
    return tuple(measured)


def compare(base: Drives, run: Drives) -> tuple[Compared, ...]:
    """Every figure of two runs over the same drives, in the same order."""
    compared = []
    for figure in FIGURES:
        pairs = [(figure.part(a), figure.part(b)) for a, b in zip(base, run, strict=True)]
        interval = bootstrap(pairs, partial(_difference, figure))
        compared.append(Compared(figure, figure.of(base), figure.of(run), interval))
    return tuple(compared)


def _difference(figure: Figure, pairs: Sequence[tuple[Any, Any]]) -> float | None:
    base, run = (figure.whole(side) for side in zip(*pairs, strict=True))
    return None if base is None or run is None else run - base


def bootstrap(parts: Sequence[Any], whole: Callable[[Sequence[Any]], float | None]) -> Interval | None:
    """95 % confidence interval of a metric from resampling drives with replacement, with a fixed seed. None if fewer
    than two drives have the metric."""
    if sum(whole([part]) is not None for part in parts) < 2:
        return None
    draws = np.sort(np.random.default_rng(SEED).integers(len(parts), size=(RESAMPLES, len(parts))), axis=1)
    known = {draw: whole([parts[n] for n in draw]) for draw in map(tuple, np.unique(draws, axis=0).tolist())}
    values = [value for draw in map(tuple, draws.tolist()) if (value := known[draw]) is not None]
    low, high = np.quantile(values, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2])
    return Interval(float(low), float(high))


# ---------------------------------------------------------------- contribution of a drive


def _sums(values: Iterable[float | None]) -> Sums:
    """For the mean of the known values."""
    known = [value for value in values if value is not None]
    return float(sum(known)), float(len(known))


def _percent(verdicts: tuple[str, ...], drive: DriveScore) -> Sums:
    return _sums(100.0 * (frame.judged.verdict in verdicts) for frame in drive.frames if frame.judged is not None)


def _a_minute(count: Callable[[DriveScore], int], drive: DriveScore) -> Sums:
    return float(count(drive)), drive.judged_s / 60.0


def _switches(drive: DriveScore) -> int:
    return drive.switches


def _drop_outs(drive: DriveScore) -> int:
    return sum(each.drop_outs for each in drive.acquisitions)


def _acquired(name: str, drive: DriveScore) -> Sums:
    return _sums(getattr(each, name) for each in drive.acquisitions)


def _cut_in_latency(drive: DriveScore) -> Sums:
    return _sums(each.latency_s for each in drive.cut_ins)


def _lead_error(drive: DriveScore) -> Sums:
    errors = (frame.judged.error_m for frame in drive.frames if frame.judged is not None)
    return _sums(None if error is None else abs(error) for error in errors)


def _mae(name: str, drive: DriveScore) -> Sums:
    values = (getattr(error, name) for frame in drive.frames for error in frame.errors)
    return _sums(None if value is None else abs(value) for value in values)


def _counted(sums: Callable[[Counts], Sums], drive: DriveScore) -> Sums:
    """A ratio of trackeval's counts, in percent."""
    over, under = sums(drive.tracking) if drive.tracking is not None else (0.0, 0.0)
    return 100.0 * float(over), float(under)


def _tracked(drive: DriveScore) -> Counts | None:
    return drive.tracking


def _hota(parts: Sequence[Counts | None]) -> float | None:
    value = hota_of([part for part in parts if part is not None])
    return None if value is None else 100.0 * value


def _alarms(kind: AlarmKind, drive: DriveScore) -> list[Alarm]:
    return [alarm for alarm in drive.alarms if alarm.kind == kind]


def _delay(kind: AlarmKind, drive: DriveScore) -> Sums:
    return _sums(alarm.delay_s for alarm in _alarms(kind, drive))


def _never_acted(kind: AlarmKind, drive: DriveScore) -> Sums:
    return _sums(100.0 * (each.acted_ns is None) for each in _alarms(kind, drive) if each.due_ns is not None)


def _without_danger(kind: AlarmKind, drive: DriveScore) -> Sums:
    return float(sum(alarm.due_ns is None for alarm in _alarms(kind, drive))), drive.guarded_s / 60.0


FIGURES: tuple[Figure, ...] = (
    Figure("cipv_correct", "CIPV correct", "%", "higher", partial(_percent, ("correct", "none"))),
    Figure("lead_missed", "lead missed", "%", "lower", partial(_percent, ("missed",))),
    Figure("cipv_false", "CIPV without a lead", "%", "lower", partial(_percent, ("false",))),
    Figure("cipv_wrong", "wrong CIPV", "%", "lower", partial(_percent, ("wrong",))),
    Figure("switches", "switches", "per minute", "lower", partial(_a_minute, _switches)),
    Figure("drop_outs", "drop-outs", "per minute", "lower", partial(_a_minute, _drop_outs)),
    Figure("acquired_m", "acquisition distance", "m", "higher", partial(_acquired, "range_m")),
    Figure("acquired_s", "acquisition time", "s", "lower", partial(_acquired, "after_s")),
    Figure("cut_in_latency", "cut-in latency", "s", "lower", _cut_in_latency),
    Figure("lead_distance", "distance error of the lead", "m", "lower", _lead_error),
    Figure("distance", "distance error", "m", "lower", partial(_mae, "distance_m")),
    Figure("lateral", "lateral error", "m", "lower", partial(_mae, "lateral_m")),
    Figure("longitudinal", "longitudinal error", "m", "lower", partial(_mae, "longitudinal_m")),
    Figure("speed", "speed error", "m/s", "lower", partial(_mae, "speed_mps")),
    Figure("precision", "precision", "%", "higher", partial(_counted, precision_sums)),
    Figure("recall", "recall", "%", "higher", partial(_counted, recall_sums)),
    Figure("mota", "MOTA", "%", "higher", partial(_counted, mota_sums)),
    Figure("idf1", "IDF1", "%", "higher", partial(_counted, idf1_sums)),
    Figure("hota", "HOTA", "%", "higher", _tracked, _hota),
    Figure("warning_delay", "warning delay", "s", "lower", partial(_delay, "warning")),
    Figure("warning_missing", "missed warnings", "%", "lower", partial(_never_acted, "warning")),
    Figure(
        "warning_false",
        "false warnings",
        "per minute",
        "lower",
        partial(_without_danger, "warning"),
    ),
    Figure("braking_delay", "braking delay", "s", "lower", partial(_delay, "braking")),
    Figure("braking_missing", "missed braking", "%", "lower", partial(_never_acted, "braking")),
    Figure(
        "braking_false",
        "false braking",
        "per minute",
        "lower",
        partial(_without_danger, "braking"),
    ),
)
"""In the order of a report. Errors are mean absolute ones."""
