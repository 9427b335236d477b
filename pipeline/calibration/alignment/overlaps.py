"""How well projected clusters and boxes cover each other (IoU), and the angular model that makes it best.

An angular model is never exact, so its best values depend on what is asked for. Edges of boxes ask for a compromise
between all four edges; fusion pairs objects by IoU, so that is what the last step of its fit maximises.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from pipeline.calibration.alignment.models import FitModel
from pipeline.calibration.alignment.pairs import PairTable
from pipeline.types import F64

COVERED_IOU = 0.3
"""A box with a smaller overlap may belong to an object that only the camera sees."""
_UNIT = np.array([0.02, 0.02, 0.2, 0.2])
"""Steps of the search: shares of the resolutions, and degrees of the origin. They move an edge by a few pixels."""
_EVALUATIONS = 600
"""A search takes about 90."""


@dataclass(frozen=True)
class Overlaps:
    """Overlap of projected clusters and boxes, over the held-out frames."""

    mean_iou: float
    """Over the boxes that are covered by a cluster, before or after the fit."""
    paired: int
    """Number of these boxes with an IoU of at least one half."""
    boxes: int
    """Number of these boxes."""


def overlaps_of(table: PairTable, model: FitModel, vectors: Sequence[F64]) -> list[Overlaps]:
    """The overlaps for each vector, over the same boxes: those seen by both sensors. Distant ones have no cluster in
    any case."""
    best = np.array([_best(table, model, vector) for vector in vectors])
    shared = best[:, best.max(axis=0) >= COVERED_IOU]
    return [
        Overlaps(round(float(row.mean()), 4) if len(row) else 0.0, int(np.count_nonzero(row >= 0.5)), len(row))
        for row in shared
    ]


def most_overlap(table: PairTable, model: FitModel, start: F64) -> F64:
    """The vector of an angular model with the largest mean IoU of the boxes that ``start`` covers, by Powell's method
    from there."""
    covered = _best(table, model, start) >= COVERED_IOU
    if not covered.any():
        return start
    near = table.only(np.flatnonzero(covered[table.box]))

    def missing(at: F64) -> float:
        return -float(_best(near, model, start + at * _UNIT)[covered].mean())

    found = minimize(
        missing, np.zeros(len(start)), method="Powell", options={"maxfev": _EVALUATIONS, "xtol": 0.02, "ftol": 1e-4}
    )
    return np.asarray(start + found.x * _UNIT)


def _best(table: PairTable, model: FitModel, vector: F64) -> F64:
    """(B,) largest overlap of each box with a cluster."""
    best = np.zeros(len(table.boxes))
    np.maximum.at(best, table.box, table.overlap(model.aligned(vector)))
    return best
