"""How well scores without labels predict figures against labels: rank correlation over drives and runs. A score can be
trusted on unlabelled drives only if it ranks drives and parameters as labels do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import rankdata

from app.fleet.batch.drive_scores import LABELLED
from app.fleet.compare.paired import ScoreRow
from pipeline.evaluation.label_free.score import SCORES, LabelFreeScore
from pipeline.evaluation.scores.figures import CONFIDENCE, RESAMPLES, SEED, Interval
from pipeline.types import F64

FEWEST = 8
"""Fewest pairs of values for a correlation."""


@dataclass(frozen=True)
class Worth:
    """A score and its counterpart against labels."""

    score: LabelFreeScore
    """The one that needs no labels; names its counterpart."""
    drives: int
    """With both."""
    pairs: int
    """Values of both: drives times runs."""
    rank_correlation: float | None
    """Spearman's, over all pairs; None where there are too few or all are equal."""
    interval: Interval | None
    """95 %, drives drawn with replacement, each with all of its runs."""
    over_runs: float | None
    """Spearman's of the runs' values over the whole fleet; None for fewer than four runs."""

    @property
    def holds(self) -> bool:
        """Whether it significantly ranks as labels do."""
        return self.interval is not None and self.interval.low > 0.0


def worths(runs: Mapping[str, Iterable[ScoreRow]], scores: Sequence[LabelFreeScore] = SCORES) -> list[Worth]:
    """Every score, over the drives that have labels. runs: by name, the scores of each drive."""
    tables = {run: {(drive, score): (over, under) for drive, score, over, under in rows} for run, rows in runs.items()}
    return [_worth(score, tables) for score in scores]


def _worth(score: LabelFreeScore, tables: Mapping[str, Mapping[tuple[str, str], tuple[float, float]]]) -> Worth:
    there = LABELLED + score.counterpart
    by_drive: dict[str, list[tuple[float, float]]] = {}
    totals = []
    for table in tables.values():
        total = np.zeros((2, 2))
        for drive in sorted({drive for drive, _ in table}):
            free, labelled = table.get((drive, score.name), (0.0, 0.0)), table.get((drive, there), (0.0, 0.0))
            if free[1] > 0.0 and labelled[1] > 0.0:
                by_drive.setdefault(drive, []).append((free[0] / free[1], labelled[0] / labelled[1]))
                total += [free, labelled]
        if total[0, 1] > 0.0:
            totals.append(total[:, 0] / total[:, 1])
    groups = [np.array(pairs) for pairs in by_drive.values()]
    pairs = sum(map(len, groups))
    value = spearman(np.concatenate(groups)) if pairs >= FEWEST else None
    over_runs = spearman(np.array(totals)) if len(totals) > 3 else None
    return Worth(score, len(groups), pairs, value, _interval(groups) if value is not None else None, over_runs)


def values_of(rows: Iterable[ScoreRow]) -> dict[str, float | None]:
    """Of the whole fleet, by score."""
    sums: dict[str, list[float]] = {}
    for _, score, over, under in rows:
        total = sums.setdefault(score, [0.0, 0.0])
        total[0], total[1] = total[0] + over, total[1] + under
    return {score: total[0] / total[1] if total[1] else None for score, total in sorted(sums.items())}


def spearman(pairs: F64) -> float | None:
    """Rank correlation of (N, 2) pairs; None where all values of one side are equal."""
    a, b = rankdata(pairs[:, 0]), rankdata(pairs[:, 1])
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return None
    return float(np.corrcoef(a, b)[0, 1])


def _interval(groups: Sequence[F64]) -> Interval | None:
    """By bootstrap over the drives; None for a single one."""
    if len(groups) < 2:
        return None
    random = np.random.default_rng(SEED)
    values = []
    for _ in range(RESAMPLES):
        drawn = random.integers(len(groups), size=len(groups))
        value = spearman(np.concatenate([groups[n] for n in drawn]))
        if value is not None:
            values.append(value)
    if not values:
        return None
    low, high = np.quantile(values, [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2])
    return Interval(float(low), float(high))
