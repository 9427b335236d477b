"""End-to-end exports (v10 and v26 style): final boxes, suppressed in the graph."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.inference.graph import Size
from pipeline.types import F32
from pipeline.vision.heads.decoder import BoxOutputs, Decoded, Decoder, Head

_MOST_ROWS = 1000


def decode(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """(1, N, 6) rows ``x1 y1 x2 y2 score class``."""
    rows = outputs[0][0]
    rows = rows[(rows[:, 4] >= floor) & np.isfinite(rows).all(axis=1)]
    return rows[:, :4].astype(np.float32), rows[:, 4].astype(np.float32), rows[:, 5].astype(np.int64)


def _marked(answer: BoxOutputs) -> Decoder | None:
    """Recognised by metadata in the graph."""
    return _by_shape(answer) if answer.metadata.get("end2end") == "True" else None


def _by_shape(answer: BoxOutputs) -> Decoder | None:
    table = answer.single
    if table is None or table.shape[1] != 6:
        return None
    return Decoder("end to end", 0, True, 1 / 255, False, decode)


def _few_rows(answer: BoxOutputs) -> Decoder | None:
    """Recognised by six columns, and no more rows than an export keeps."""
    table = answer.single
    return _by_shape(answer) if table is not None and len(table) <= _MOST_ROWS else None


MARKED = Head("end-to-end exports", _marked)
ROWS = Head("end-to-end exports", _few_rows)
