"""Every score of one drive: those without labels and, if the recording has labels, those against them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.evaluation.label_free.history import History
from pipeline.evaluation.label_free.score import DriveScores, label_free_scores
from pipeline.evaluation.scores.drive import DriveScore, Rules, score_drive
from pipeline.evaluation.scores.figures import FIGURES, ratio
from pipeline.evaluation.scores.truth import of_source
from pipeline.params import Params
from pipeline.types import Result
from pipeline.types.sensors import CAMERA
from pipeline.types.source import Source

LABELLED = "labelled."
"""Prefix of scores that use labels."""


def scores_of(history: History, labelled: Sequence[Result], source: Source, params: Params) -> DriveScores:
    """labelled: the results of the labelled frames, without layers."""
    scores = label_free_scores(history, params.time.reset_gap_s)
    if labelled:
        rules = Rules(aeb=params.aeb)
        drive = score_drive(labelled, of_source(source, rules.lead), rules)
        scores |= {LABELLED + name: sums for name, sums in labelled_scores(drive).items()}
    return scores


def labelled_scores(drive: DriveScore) -> DriveScores:
    """The figures of ``cipv evaluate`` that are sums divided by counts, and those of the camera alone."""
    scores = {figure.name: figure.part(drive) for figure in FIGURES if figure.whole is ratio}
    errors = [error for frame in drive.frames for error in frame.errors if error.source == CAMERA.letter]
    shares = [100.0 * abs(error.distance_m) / error.range_m for error in errors if error.range_m > 1.0]
    speeds = [abs(error.speed_mps) for error in errors if error.speed_mps is not None]
    correct, judged = scores["cipv_correct"]
    scores["lead_not_correct"] = 100.0 * judged - correct, judged
    scores["camera_distance"] = float(np.sum(shares)), float(len(shares))
    scores["camera_speed"] = float(np.sum(speeds)), float(len(speeds))
    return scores
