"""Finds the mount and lens of a fit: a coarse search over a grid, then a refinement from its best points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from pipeline.calibration.alignment.doubts import Found
from pipeline.calibration.alignment.models import STEP_DEG, FitModel
from pipeline.calibration.alignment.pairs import PairTable, coarse_scores
from pipeline.common.progress import Progress
from pipeline.types import F64

COARSE_FRAMES, FIRST_FRAMES, FIRST_SHARE = 30, 8, 0.1
"""The coarse search uses the frames with the most boxes: a few for the whole grid, then more for its best tenth."""
COARSE_STEPS = 8
STARTS = 6
"""Number of best grid points that are refined."""
GATES = ((4.0, 3.0), (2.5, 2.5), (1.5, 2.5), (1.0, 2.5), (1.0, 2.5), (1.0, 2.5))
"""Rounds of the refinement: factor on the edge uncertainty, and the pairs' gate in standard deviations."""
LOSS_SCALE = 1.0
"""Standard deviations from which the loss grows only linearly (soft L1)."""
OFFSET_SIGMA_M = 0.3
"""Prior for the camera's position, if the pairs do not determine it."""
SQUARE_SIGMA = 0.02
"""Permitted relative difference of the two resolutions of a camera with square pixels."""
SEARCH_STEPS = COARSE_STEPS + STARTS
"""Number of progress steps of a search."""


def search(table: PairTable, model: FitModel, progress: Progress, steps: int) -> list[Found]:
    """Refined optima, best first. steps: of the whole fit, for the progress; the search takes ``SEARCH_STEPS``."""
    grid = model.grid()
    slack_px = 0.6 * STEP_DEG * _pixels_per_degree(model)
    scores = np.zeros(len(grid))
    few = _richest(table, FIRST_FRAMES)
    for part, at in enumerate(np.array_split(np.arange(len(grid)), COARSE_STEPS)):
        progress(part, steps)
        scores[at] = coarse_scores(few, model, grid[at], 2.0, slack_px)
    best = np.argsort(-scores, kind="stable")[: max(STARTS, round(FIRST_SHARE * len(grid)))]
    grid, scores = grid[best], coarse_scores(_richest(table, COARSE_FRAMES), model, grid[best], 2.0, slack_px)
    found = []
    for number, start in enumerate(_peaks(model, grid, scores)):
        progress(COARSE_STEPS + number, steps)
        found.append(refine(table, model, start))
    return sorted(found, key=lambda each: -each.explained)


def _pixels_per_degree(model: FitModel) -> float:
    if model.camera is not None:
        return float(model.camera.K[0, 0] * np.radians(1.0))
    return model.size[0] / 60.0


def _richest(table: PairTable, frames: int) -> PairTable:
    """Only the frames with the most boxes."""
    count = np.bincount(table.frame)
    return table.taken(np.sort(np.argsort(-count, kind="stable")[:frames]))


def _peaks(model: FitModel, grid: F64, scores: F64) -> list[F64]:
    """The best grid points that are not neighbours of each other."""
    scale = np.array([0.2, 0.2, 4.0, 4.0]) if model.name == "angular" else np.full(grid.shape[1], 2.5)
    if model.zoom is None:
        scale[-1] = 0.2
    chosen: list[F64] = []
    for vector in grid[np.argsort(-scores, kind="stable")]:
        if all(np.abs((vector - other) / scale).max() > 1.0 for other in chosen):
            chosen.append(vector)
            if len(chosen) == STARTS:
                break
    return chosen


def refine(table: PairTable, model: FitModel, start: F64, gates: Sequence[tuple[float, float]] = GATES) -> Found:
    """Repeatedly match pairs and optimise, from a start within some degrees."""
    vector, rows = start, np.zeros(0, np.int64)
    low, high = model.bounds()
    for widen, gate in gates:
        rows = table.matched(table.residuals(model.aligned(vector), widen), gate)
        if len(rows) < 3:
            break
        some = table.only(rows)

        def off(at: F64, some: PairTable = some, widen: float = widen) -> F64:
            return np.concatenate([some.residuals(model.aligned(at), widen).ravel(), _prior(model, at)])

        solved = least_squares(
            off, np.clip(vector, low + 1e-9, high - 1e-9), bounds=(low, high), loss="soft_l1", f_scale=LOSS_SCALE
        )
        vector = solved.x
    return Found(vector, rows, explained(table, model, vector))


def explained(table: PairTable, model: FitModel, vector: F64) -> float:
    """Number of boxes with a cluster of their own, weighted by the quality of the match."""
    off = table.residuals(model.aligned(vector), 1.5)
    return float(np.exp(-0.5 * np.mean(off[table.matched(off, np.inf)] ** 2, axis=1)).sum())


def _prior(model: FitModel, vector: F64) -> F64:
    """Residuals of the prior, in standard deviations."""
    if model.name == "pinhole":
        roll_deg, sigma_deg = model.roll_deg
        place = vector[3:5] if model.offset else vector[:0]
        return np.array([(vector[2] - roll_deg) / sigma_deg, *(place / OFFSET_SIGMA_M)])
    return np.array([(vector[1] - vector[0]) / SQUARE_SIGMA])
