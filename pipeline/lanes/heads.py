"""What lane networks put out, as points in the picture. Each head is recognised by the shapes of the outputs.

=========  =====================================  ====================================================================
two masks  (1, 2, h, w) twice                     TwinLiteNet (BDD100K): drivable area, then lane lines; 0–1, RGB
YOLOP      the two masks and (1, n, 6) boxes      YOLOP (BDD100K): letterboxed, ImageNet mean and spread, RGB
classes    (1, 2 or more, h, w), perhaps (1, k)   ENet-SAD and its like (CULane): class 0 nothing, then one a line,
                                                  and the probability that it is there; CULane's mean and spread, RGB
row grid   (1, cells + 1, rows, lines)            UFLD (CULane 18 rows, TuSimple 56): a place in each row for each line,
                                                  the last cell says that there is none; stretched, ImageNet, RGB
=========  =====================================  ====================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipeline.common.geometry import F64
from pipeline.types import F32

Fit = Literal["stretch", "letterbox", "lower"]
"""How a picture is fitted to the input: stretched; scaled whole onto grey; its lower part, in the input's aspect."""
_ROWS = 180
"""A mask is read in about so many of its rows: finer adds nothing a fit would notice."""
_WIDEST = 1 / 8
"""A run of lane pixels wider than this share of the mask is no line seen along the road."""
_IMAGENET = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
_CULANE = ((0.3598, 0.3653, 0.3662), (0.2573, 0.2663, 0.2756))
_CUT_ASPECT = 4.0
"""An input wider than this is for pictures whose sky was cut off (CULane at 976×208)."""
_THERE = 0.5
_TUSIMPLE_ROWS = (np.arange(56) * 10 + 160) / 720
_CULANE_ROWS = (
    np.array([121, 131, 141, 150, 160, 170, 180, 189, 199, 209, 219, 228, 238, 248, 258, 267, 277, 287]) / 288
)


class UnknownLaneHead(ValueError):
    """The outputs are of no known lane network; the text says what they are."""


@dataclass(frozen=True, eq=False)
class Points:
    """In shares of the network's input, 0–1 from its left and upper edge. uv: (M, 2). score: (M,). line: (M,)."""

    uv: F64
    score: F32
    line: npt.NDArray[np.int32]


@dataclass(frozen=True)
class Head:
    """How one family takes its picture (RGB, from 0–1 to mean 0 and spread 1), and which of its outputs holds the lines
    and, where there is one, which the probability of each."""

    name: str
    output: int
    fit: Fit
    exists: int | None = None
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spread: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def points(self, outputs: Sequence[F32]) -> Points:
        """The lines' points in the network's answer."""
        values = np.asarray(outputs[self.output][0], np.float32)
        found = _from_rows(values) if self.name == "row grid" else _from_masks(values)
        if self.exists is None:
            return found
        there = np.asarray(outputs[self.exists]).ravel()[found.line] > _THERE
        return Points(found.uv[there], found.score[there], found.line[there])


def pick_head(outputs: Sequence[F32], names: Sequence[str]) -> Head:
    """The head that gives outputs of these shapes. UnknownLaneHead for any other."""
    shapes = [np.asarray(output).shape for output in outputs]
    masks = [i for i, shape in enumerate(shapes) if len(shape) == 4 and shape[:2] == (1, 2)]
    if len(masks) == 2:
        lanes = next((i for i in masks if names[i].lower().startswith(("ll", "lane"))), masks[1])
        if any(len(shape) == 3 and shape[2] == 6 for shape in shapes):
            return Head("YOLOP", lanes, "letterbox", None, *_IMAGENET)
        return Head("two masks", lanes, "stretch")
    four = [i for i, shape in enumerate(shapes) if len(shape) == 4 and shape[0] == 1]
    if len(four) == 1:
        _, channels, rows, columns = shapes[four[0]]
        if rows in (len(_CULANE_ROWS), len(_TUSIMPLE_ROWS)) and columns <= 8 and channels > 50:
            return Head("row grid", four[0], "stretch", None, *_IMAGENET)
        if 2 <= channels <= 16 and rows >= 32 and columns >= 32:
            exists = next((i for i, shape in enumerate(shapes) if shape == (1, channels - 1)), None)
            fit: Fit = "lower" if columns > _CUT_ASPECT * rows else "stretch"
            return Head("classes", four[0], fit, exists, *_CULANE)
    described = ", ".join("×".join(map(str, shape)) for shape in shapes)
    raise UnknownLaneHead(f"its outputs ({described}) are of no lane network known here")


def _from_masks(values: F32) -> Points:
    """(C, h, w) scores of nothing and of C − 1 kinds of line → the middles of their runs in every few rows. Two
    channels do not say which line a pixel is of."""
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
    """Probability of the best class: a softmax, unless the network has made probabilities already."""
    low, high = float(values.min()), float(values.max())
    if low >= 0.0 and high <= 1.0:
        return np.asarray(values.max(axis=0) / np.maximum(values.sum(axis=0), 1e-6), np.float32)
    top = values.max(axis=0)
    return np.asarray(1.0 / np.exp(values - top).sum(axis=0), np.float32)


def _runs(mask: npt.NDArray[np.bool_]) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Row, first column and first column beyond of every run of true values in the rows of (R, w)."""
    edged = np.zeros((mask.shape[0], mask.shape[1] + 2), np.int8)
    edged[:, 1:-1] = mask
    steps = np.diff(edged, axis=1)
    row, first = np.nonzero(steps == 1)
    _, beyond = np.nonzero(steps == -1)
    return row, first, beyond


def _from_rows(values: F32) -> Points:
    """(cells + 1, rows, lines) → the expected cell in each row for each line (Qin et al., "Ultra Fast
    Structure-aware Deep Lane Detection", ECCV 2020, Eq. 3), where "no line" is not the best answer."""
    cells, rows = values.shape[0] - 1, values.shape[1]
    anchors = _CULANE_ROWS if rows == len(_CULANE_ROWS) else _TUSIMPLE_ROWS
    weight = np.exp(values[:-1] - values[:-1].max(axis=0))
    place = np.tensordot(np.arange(cells), weight, axes=1) / weight.sum(axis=0) / (cells - 1)
    row, line = np.nonzero(np.argmax(values, axis=0) != cells)
    uv = np.column_stack([place[row, line], anchors[row]])
    there = np.exp(values - values.max(axis=0))
    score = 1.0 - there[-1] / there.sum(axis=0)
    return Points(uv, score[row, line].astype(np.float32), line.astype(np.int32))
