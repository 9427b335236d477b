"""Shared by all heads: the form of a decoder, the grid, and boxes from centres and sizes.

Every decoder takes the network's raw outputs and its input size ``(height, width)`` and gives candidates scored at or
above a floor: boxes (M, 4) float32 ``x1 y1 x2 y2`` in network-input pixels, scores (M,) float32, class ids (M,) int64.
Scores are the best class's probability, times objectness where the head has one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.inference.graph import Size
from pipeline.types import F32, I64

Decoded = tuple[F32, F32, I64]

STRIDES = (8, 16, 32)
"""Input pixels per grid cell of the usual three maps."""
STRIDE_SETS = (STRIDES, (8, 16, 32, 64), (16, 32))
"""Combinations of strides that occur in exports."""


class UnknownHead(ValueError):
    """Outputs that no head recognises; the text lists their shapes."""


@dataclass(frozen=True)
class Decoder:
    """How to decode a network's outputs, and what input it expects."""

    name: str
    """The head's display name."""
    classes: int
    """Number of classes; 0 if its shapes do not tell."""
    rgb: bool
    """Whether its input is RGB instead of BGR."""
    scale: float
    """Pixel values 0–255 are multiplied by this."""
    own_grid: bool
    """Whether the decoder applies the grid itself. Otherwise the graph contains a grid that another input size would
    break."""
    decode: Callable[[Sequence[F32], Size, float], Decoded]
    """(outputs, input size, lowest score) → candidates."""


class BoxOutputs(NamedTuple):
    """A network's outputs for some image, used to recognise its head."""

    outputs: Sequence[F32]
    """In the network's order."""
    size: Size
    """Height, width of its input in pixels."""
    metadata: Mapping[str, str]
    """Metadata of the file: some exporters store the model family there."""

    @property
    def single(self) -> F32 | None:
        """The first output as (rows, columns) if it is a single table; else None."""
        first = self.outputs[0] if self.outputs else None
        return first[0] if first is not None and first.ndim == 3 and first.shape[0] == 1 else None

    def cells(self, strides: Sequence[int] = STRIDES) -> int:
        """Total number of grid cells of the input at these strides."""
        return sum((self.size[0] // s) * (self.size[1] // s) for s in strides)


class Head(NamedTuple):
    """One output format of YOLO networks."""

    family: str
    """Display name of the networks that use it."""
    recognise: Callable[[BoxOutputs], Decoder | None]
    """Returns the decoder if the outputs have this format, else None."""


def grid_centres(size: Size, strides: Sequence[int] = STRIDES) -> tuple[F32, F32]:
    """(N, 2) cell indices x y and (N, 1) strides, row by row, finest stride first."""
    cells, steps = [], []
    for stride in strides:
        rows, columns = size[0] // stride, size[1] // stride
        y, x = np.mgrid[:rows, :columns]
        cells.append(np.column_stack([x.ravel(), y.ravel()]))
        steps.append(np.full((rows * columns, 1), stride))
    return np.concatenate(cells).astype(np.float32), np.concatenate(steps).astype(np.float32)


def decode_objectness(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """(1, N, 5+C) with centre and size in pixels: concatenated exports of v3/v5/v7, v6, YOLOX decoded in the graph."""
    rows = outputs[0][0]
    rows = rows[rows[:, 4] >= floor]
    return above(rows[:, :2], rows[:, 2:4], rows[:, 4:5] * rows[:, 5:], floor)


def above(centre: F32, extent: F32, class_scores: F32, floor: float) -> Decoded:
    """Corner boxes of the candidates whose best class reaches the floor; non-finite candidates are dropped."""
    if not len(class_scores):
        return np.zeros((0, 4), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int64)
    classes = np.argmax(class_scores, axis=1)
    scores = class_scores[np.arange(len(classes)), classes]
    boxes = np.column_stack([centre - extent / 2, centre + extent / 2])
    keep = (scores >= floor) & np.isfinite(boxes).all(axis=1)
    return boxes[keep].astype(np.float32), scores[keep].astype(np.float32), classes[keep].astype(np.int64)
