"""YOLOX (Ge 2021, section 2.1): centre offset and log size on a grid, raw or decoded in the graph."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.inference.graph import Size
from pipeline.types import F32
from pipeline.vision.heads.decoder import (
    STRIDES,
    BoxOutputs,
    Decoded,
    Decoder,
    Head,
    above,
    decode_objectness,
    grid_centres,
)


def decode_yolox(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """Default export: (1, N, 5+C), centres and log sizes relative to the grid, scores already probabilities."""
    rows = outputs[0][0]
    keep = np.flatnonzero(rows[:, 4] >= floor)
    cells, steps = (part[keep] for part in grid_centres(size))
    kept = rows[keep]
    centre = (kept[:, :2] + cells) * steps
    extent = np.exp(np.minimum(kept[:, 2:4], 20.0)) * steps
    return above(centre, extent, kept[:, 4:5] * kept[:, 5:], floor)


def _raw(answer: BoxOutputs) -> Decoder | None:
    """Recognised by centres that are offsets of about one cell, where pixels would be hundreds."""
    table = _one_row_a_cell(answer)
    if table is None or float(np.median(np.abs(table[:, :2]))) >= STRIDES[0]:
        return None
    return Decoder("yolox", table.shape[1] - 5, False, 1.0, True, decode_yolox)


def _decoded(answer: BoxOutputs) -> Decoder | None:
    table = _one_row_a_cell(answer)
    if table is None:
        return None
    return Decoder("yolox decoded", table.shape[1] - 5, False, 1.0, False, decode_objectness)


def _one_row_a_cell(answer: BoxOutputs) -> F32 | None:
    table = answer.single
    return table if table is not None and len(table) == answer.cells() and table.shape[1] > 5 else None


RAW = Head("YOLOX", _raw)
DECODED = Head("YOLOX", _decoded)
