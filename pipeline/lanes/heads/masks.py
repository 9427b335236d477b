"""Extracts points on lines, and on the edges of the road, from masks that classify each pixel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.lanes.heads.head import Points
from pipeline.types import F32
from pipeline.types.detections import ROAD_LEFT, ROAD_RIGHT

_ROWS = 180
"""About this many rows of a mask are sampled: more would not improve the fit."""
_LOWER = 0.6
"""The drivable area begins below this share of the mask's height; above the bonnet of the car."""
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


def road_edges(values: F32) -> Points:
    """(2, h, w) scores of other ground and drivable area → where the area in front of the car ends on the left and on
    the right, sampled every few rows. From row to row upwards, the area goes on where it overlaps most; the image's
    border is no edge."""
    _, height, width = values.shape
    rows = np.arange(height - 1, -1, -max(1, height // _ROWS))
    sureness = _sureness(values[:, rows])
    row, first, beyond = _runs(values[1, rows] > values[0, rows])
    uv, score, line, begun = [], [], [], False
    last = (0.5 * width, 0.5 * width + 1.0)
    for k in range(len(rows)):
        here = np.flatnonzero(row == k)
        overlap = np.minimum(beyond[here], last[1]) - np.maximum(first[here], last[0])
        if not len(here) or overlap.max() <= 0:
            if begun or rows[k] < _LOWER * height:
                break
            continue  # the car's own bonnet
        begun, best = True, here[int(overlap.argmax())]
        last = (float(first[best]), float(beyond[best]))
        sure = float(sureness[k, first[best] : beyond[best]].mean())
        for side, at in ((ROAD_LEFT, first[best]), (ROAD_RIGHT, beyond[best])):
            if 0 < at < width:
                uv.append((at / width, (rows[k] + 0.5) / height))
                score.append(sure)
                line.append(side)
    return Points(np.array(uv, np.float64).reshape(-1, 2), np.array(score, np.float32), np.array(line, np.int32))


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
