"""Scores runs of a drive against its labels, with the figures of ``cipv evaluate``, after every change."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.drive.compare import Metric
from app.drive.frame_rows import Row
from app.drive.full_run import DriveRun
from app.drive.open_recording import RULE
from app.drive.run_results import results_of
from pipeline.common.errors import BadInput
from pipeline.evaluation.lead_verdict import Judged
from pipeline.evaluation.report_sections import Cell
from pipeline.evaluation.scores.drive import DriveScore, Rules, judged, score_drive
from pipeline.evaluation.scores.error_tables import error_rows
from pipeline.evaluation.scores.figures import FIGURES
from pipeline.evaluation.scores.report import MOST
from pipeline.evaluation.scores.truth import DriveTruth, NoTruth, of_labels
from pipeline.evaluation.scores.worst import Bad, worst
from pipeline.labels.classes import ClassList, as_bases, default_classes
from pipeline.sources.driven_way import DrivenWay

if TYPE_CHECKING:
    from app.labels.store.drive_labels import DriveLabels

_MOST_HELD = 8


@dataclass(frozen=True)
class Standing:
    """Score of a run against the labels."""

    judged: int
    """Number of frames with a labelled lead."""
    metrics: tuple[Metric, ...]
    """All metrics that this or the other run has."""
    notes: tuple[str, ...]
    """What is not counted, and why."""
    errors: tuple[tuple[Cell, ...], ...]
    """Rows of ``error_rows``."""
    worst: tuple[Bad, ...]
    """Frames to look at first."""


class LabelScores:
    """Any thread. Scores are cached until labels or runs change."""

    def __init__(
        self, classes: ClassList | None = None, way_of: Callable[[DriveLabels], DrivenWay | None] = lambda _: None
    ) -> None:
        """classes: for recordings whose project has none. Sub-classes are scored as their parent class. way_of: the way
        of the recording that labels are of, None if it is not open any more."""
        self._way_of = way_of
        self._classes = classes or default_classes()
        self._lock = threading.Lock()
        self._of: tuple[DriveLabels, int, ClassList] | None = None
        self._truth: DriveTruth | None = None
        self._scores: dict[tuple[int, int], DriveScore | None] = {}

    def truth(self, labels: DriveLabels) -> tuple[int, DriveTruth | None]:
        """(revision, labels accepted by people; None without any)."""
        with self._lock:
            revision, classes = labels.revision, labels.classes() or self._classes
            if self._of is None or self._of[0] is not labels or self._of[1:] != (revision, classes):
                try:
                    self._truth = of_labels(as_bases(labels.unnamed_set(), classes), RULE, lambda: self._way_of(labels))
                except NoTruth:
                    self._truth = None
                self._of, self._scores = (labels, revision, classes), {}
            return revision, self._truth

    def score(self, labels: DriveLabels, run: DriveRun) -> DriveScore | None:
        """Score of one run; None if no labelled frame has a result yet."""
        revision, truth = self.truth(labels)
        key = (run.number, run.done)
        with self._lock:
            if truth is None or self._of is None or self._of[:2] != (labels, revision):
                return None
            if key not in self._scores:
                if len(self._scores) >= _MOST_HELD:
                    self._scores.clear()
                self._scores[key] = _scored(run, truth)
            return self._scores[key]

    def standing(self, labels: DriveLabels, base: DriveRun, run: DriveRun) -> Standing:
        """Scores of a run compared with another, and what is not counted; without metrics if nothing is labelled."""
        _, truth = self.truth(labels)
        old, new = self.score(labels, base), self.score(labels, run)
        if new is None:
            return Standing(0, (), truth.notes if truth is not None else (), (), ())
        found = [
            Metric(figure.title, figure.unit, figure.of([old]) if old else None, figure.of([new]), figure.better)
            for figure in FIGURES
        ]
        return Standing(
            sum(frame.judged is not None for frame in new.frames),
            tuple(each for each in found if each.base is not None or each.run is not None),
            new.notes,
            error_rows([new]),
            tuple(worst([new], MOST)),
        )

    def judged_rows(self, labels: DriveLabels, run: DriveRun) -> list[Row] | None:
        """A run's rows, judged by labels instead of the recording's truth; None if there are no labels. Used while a
        run is in progress, so only the lead is evaluated."""
        _, truth = self.truth(labels)
        rows = run.rows()
        found = _judged(run, truth) if truth is not None else {}
        return [row._replace(judged=found.get(row.t_ns)) for row in rows] if found else None


def judged_by_index(score: DriveScore) -> dict[int, Judged]:
    """The frames in which the true lead is known."""
    return {frame.index: frame.judged for frame in score.frames if frame.judged is not None}


def disagreements(score: DriveScore) -> Sequence[tuple[int, Judged]]:
    """Frames in which the CIPV differs from the true lead, in order."""
    return [(index, each) for index, each in judged_by_index(score).items() if each.verdict not in ("correct", "none")]


def _judged(run: DriveRun, truth: DriveTruth) -> dict[int, Judged]:
    """Verdicts by tick."""
    rules, found = Rules(RULE), {}
    for result in results_of(run, leads_only=True):
        known = truth.frames.get(result.t_ns)
        verdict = judged(result, known, rules) if known is not None else None
        if verdict is not None:
            found[result.t_ns] = verdict
    return found


def _scored(run: DriveRun, truth: DriveTruth) -> DriveScore | None:
    try:
        return score_drive(results_of(run), truth, Rules(RULE))
    except BadInput:
        return None
