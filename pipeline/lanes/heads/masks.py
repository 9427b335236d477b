"""Extracts points from masks that classify each pixel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.lanes.heads.head import Points
from pipeline.types import F32

_ROWS = 180
"""About this many rows of a mask are sampled: more would not improve the fit."""
_WIDEST = 1 / 8
"""A run of lane pixels wider than this share of the mask is not a line along the road."""


def from_masks(values: F32) -> Points:
    """(C, h, w) scores of background and C − 1 classes of line → the middles of their runs, sampled every few rows.
    With two channels, the points are not assigned to lines."""
    channels, height, width = values.shape
    rows = np.arange(0, height, max(1, height // _ROWS))
    chosen = values[:, rows]
    best = np.argmax(chosen, axis=0)
    sureness = _sureness(chosen)
    uv, score, line = [], [], []
    for kind in range(1, channels):
        row, first, beyond = _runs(best == kind)
        narrow = beyond - first <= max(2.0, _WIDEST * width)
        row, first, beyond = row[narrow], first[narrow], beyond[narrow]
        total = np.concatenate([np.zeros((len(rows), 1)), np.cumsum(sureness, axis=1)], axis=1)
        uv.append(np.column_stack([(first + beyond) / 2.0 / width, (rows[row] + 0.5) / height]))
        score.append((total[row, beyond] - total[row, first]) / np.maximum(beyond - first, 1))
        line.append(np.full(len(row), kind - 1 if channels > 2 else -1, np.int32))
    return Points(np.concatenate(uv), np.concatenate(score).astype(np.float32), np.concatenate(line))


def _sureness(values: F32) -> F32:
    """Probability of the best class: a softmax, unless the network's outputs already are probabilities."""
    low, high = float(values.min()), float(values.max())
    if low >= 0.0 and high <= 1.0:
        return np.asarray(values.max(axis=0) / np.maximum(values.sum(axis=0), 1e-6), np.float32)
    top = values.max(axis=0)
    return np.asarray(1.0 / np.exp(values - top).sum(axis=0), np.float32)


def _runs(mask: npt.NDArray[np.bool_]) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Row, first column and end column (exclusive) of every run of true values in the rows of (R, w)."""
    edged = np.zeros((mask.shape[0], mask.shape[1] + 2), np.int8)
    edged[:, 1:-1] = mask
    steps = np.diff(edged, axis=1)
    row, first = np.nonzero(steps == 1)
    _, beyond = np.nonzero(steps == -1)
    return row, first, beyond
