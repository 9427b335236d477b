"""A place in each row for each line, (1, cells + 1, rows, lines): UFLD (CULane 18 rows, TuSimple 56).

The last cell says that there is no line. Stretched, ImageNet's mean and spread, RGB."""

from __future__ import annotations

import numpy as np

from pipeline.lanes.heads.head import IMAGENET, LaneHead, LaneOutputs, Points
from pipeline.types import F32

_TUSIMPLE_ROWS = (np.arange(56) * 10 + 160) / 720
_CULANE_ROWS = (
    np.array([121, 131, 141, 150, 160, 170, 180, 189, 199, 209, 219, 228, 238, 248, 258, 267, 277, 287]) / 288
)
_MOST_LINES, _FEWEST_CELLS = 8, 50


def recognise(answer: LaneOutputs) -> LaneHead | None:
    """A single map with many cells, and the number of rows of one of the two data sets."""
    index = answer.only_map()
    if index is None:
        return None
    _, channels, rows, columns = answer.shapes[index]
    known_rows = rows in (len(_CULANE_ROWS), len(_TUSIMPLE_ROWS))
    if not known_rows or columns > _MOST_LINES or channels <= _FEWEST_CELLS:
        return None
    return LaneHead("row grid", index, from_rows, "stretch", None, *IMAGENET)


def from_rows(values: F32) -> Points:
    """(cells + 1, rows, lines) → the expected cell in each row for each line (Qin et al., "Ultra Fast Structure-aware
    Deep Lane Detection", ECCV 2020, Eq. 3), unless "no line" has the highest score."""
    cells, rows = values.shape[0] - 1, values.shape[1]
    anchors = _CULANE_ROWS if rows == len(_CULANE_ROWS) else _TUSIMPLE_ROWS
    weight = np.exp(values[:-1] - values[:-1].max(axis=0))
    place = np.tensordot(np.arange(cells), weight, axes=1) / weight.sum(axis=0) / (cells - 1)
    row, line = np.nonzero(np.argmax(values, axis=0) != cells)
    uv = np.column_stack([place[row, line], anchors[row]])
    there = np.exp(values - values.max(axis=0))
    score = 1.0 - there[-1] / there.sum(axis=0)
    return Points(uv, score[row, line].astype(np.float32), line.astype(np.int32))
