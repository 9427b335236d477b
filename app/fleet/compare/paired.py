"""Scores of two runs, paired by drive, with confidence intervals by bootstrap over drives (Efron's percentile method,
as ``pipeline.evaluation.scores.figures``): the frames of one drive depend on one another, so whole drives are drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.fleet.batch.drive_scores import LABELLED
from pipeline.evaluation.label_free.score import SCORES
from pipeline.evaluation.scores.figures import CONFIDENCE, FIGURES, RESAMPLES, SEED, Interval
from pipeline.types import F64

Better = Literal["higher", "lower"]
ScoreRow = tuple[str, str, float, float]
"""Drive, score, what the drive adds to numerator and denominator."""
FEW = 5
"""With fewer drives, the result cannot be generalised."""


@dataclass(frozen=True)
class ScoreInfo:
    """Metadata of a score."""

    name: str
    """In tables, gates and JSON; ``LABELLED`` begins those against labels."""
    title: str
    """For reports."""
    unit: str
    """Of its value and of differences, e.g. ``m/s``."""
    better: Better
    """Which direction is an improvement."""


def known_scores() -> dict[str, ScoreInfo]:
    """By name: scores without labels, then those against labels."""
    free = [ScoreInfo(each.name, each.title, each.unit, each.better) for each in SCORES]
    labelled = [ScoreInfo(LABELLED + each.name, f"{each.title} (labels)", each.unit, each.better) for each in FIGURES]
    return {each.name: each for each in (*free, *labelled)}


@dataclass(frozen=True)
class PairedScore:
    """One score of two runs over the drives that both have."""

    info: ScoreInfo
    """Which score."""
    base: float | None
    """Its value over those drives in the run that is compared with, in its unit; None without anything to count."""
    run: float | None
    """The same in the compared run."""
    interval: Interval | None
    """95 % of run minus base; None where fewer than two drives have the score in both runs."""
    drives: int
    """That have it in both runs."""
    improved: int
    """Of those, drives in which it got better."""
    worsened: int
    """Of those, drives in which it got worse; the others are equal."""

    @property
    def difference(self) -> float | None:
        """Run minus base."""
        return None if self.base is None or self.run is None else self.run - self.base

    @property
    def worse_by(self) -> float | None:
        """How far the run is worse; negative: it is better."""
        if self.difference is None:
            return None
        return self.difference if self.info.better == "lower" else -self.difference

    @property
    def is_sure(self) -> bool:
        """Whether the interval excludes zero and there are enough drives."""
        return self.interval is not None and self.drives >= FEW and not self.interval.low <= 0.0 <= self.interval.high

    @property
    def verdict(self) -> str:
        """``better``, ``worse``, or empty where that is not sure."""
        if not self.is_sure or self.worse_by is None:
            return ""
        return "worse" if self.worse_by > 0.0 else "better"


def paired(base: Iterable[ScoreRow], run: Iterable[ScoreRow], drives: Iterable[str] | None = None) -> list[PairedScore]:
    """Every score that both runs have, over the drives that both have. drives: only these."""
    wanted = set(drives) if drives is not None else None
    sums = [_by_score(rows, wanted) for rows in (base, run)]
    found = []
    for name, info in known_scores().items():
        ours, theirs = sums[0].get(name, {}), sums[1].get(name, {})
        both = sorted(ours.keys() & theirs.keys())
        if both:
            found.append(_paired(info, np.array([ours[drive] for drive in both]), np.array([theirs[d] for d in both])))
    return found


def _by_score(rows: Iterable[ScoreRow], wanted: set[str] | None) -> dict[str, dict[str, tuple[float, float]]]:
    found: dict[str, dict[str, tuple[float, float]]] = {}
    for drive, score, over, under in rows:
        if wanted is None or drive in wanted:
            found.setdefault(score, {})[drive] = over, under
    return found


def _paired(info: ScoreInfo, base: F64, run: F64) -> PairedScore:
    """base, run: (N, 2) sums of each drive."""
    known = (base[:, 1] > 0.0) & (run[:, 1] > 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = run[known, 0] / run[known, 1] - base[known, 0] / base[known, 1]
    worse = change if info.better == "lower" else -change
    return PairedScore(
        info,
        _ratio(base.sum(axis=0)),
        _ratio(run.sum(axis=0)),
        difference_interval(base, run) if known.sum() > 1 else None,
        int(known.sum()),
        int((worse < -_SAME).sum()),
        int((worse > _SAME).sum()),
    )


_SAME = 1e-9
"""Values that differ by less are equal."""


def _ratio(sums: F64) -> float | None:
    return float(sums[0] / sums[1]) if sums[1] > 0.0 else None


def difference_interval(base: F64, run: F64) -> Interval | None:
    """95 % interval of the difference of two ratios of sums, by resampling drives in pairs with a fixed seed.

    Args:
        base, run: (N, 2) what each drive adds to numerator and denominator.
    """
    count = len(base)
    random = np.random.default_rng(SEED)
    values = []
    for _ in range(RESAMPLES):
        weights = np.bincount(random.integers(count, size=count), minlength=count).astype(np.float64)
        ours, theirs = weights @ base, weights @ run
        if ours[1] > 0.0 and theirs[1] > 0.0:
            values.append(theirs[0] / theirs[1] - ours[0] / ours[1])
    if not values:
        return None
    low, high = np.quantile(values, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2])
    return Interval(float(low), float(high))


@dataclass(frozen=True)
class DriveCondition:
    """A part of the drives."""

    name: str
    """In reports, and in JSON with the number of drives."""
    holds: Callable[[Mapping[str, float | None]], bool]
    """Of a drive's row of the table ``drives``."""


def _between(column: str, low: float, high: float) -> Callable[[Mapping[str, float | None]], bool]:
    def holds(row: Mapping[str, float | None]) -> bool:
        value = row.get(column)
        return value is not None and low <= value < high

    return holds


CONDITIONS: Sequence[DriveCondition] = (
    DriveCondition("night", _between("brightness", 0.0, 60.0)),
    DriveCondition("day", _between("brightness", 60.0, 256.0)),
    DriveCondition("below 30 km/h", _between("mean_speed_mps", 0.0, 30 / 3.6)),
    DriveCondition("30–80 km/h", _between("mean_speed_mps", 30 / 3.6, 80 / 3.6)),
    DriveCondition("above 80 km/h", _between("mean_speed_mps", 80 / 3.6, 1000.0)),
    DriveCondition("straight", _between("mean_bend_radpm", 0.0, 0.002)),
    DriveCondition("bends", _between("mean_bend_radpm", 0.002, 10.0)),
    DriveCondition("lead nearer than 20 m", _between("mean_lead_m", 0.0, 20.0)),
    DriveCondition("lead at 20–40 m", _between("mean_lead_m", 20.0, 40.0)),
    DriveCondition("lead beyond 40 m", _between("mean_lead_m", 40.0, 1000.0)),
)
"""By what two runs are compared apart. What belongs to the run itself, as the lead's distance, is the base's."""
