"""DETR exports as DEIM, D-FINE and RT-DETR publish them: ``labels``, ``boxes``, ``scores``, final but for near-doubles.

Their second input, the size of the original image, is bound to 1 × 1 when the graph is read
(``pipeline.inference.graph.with_unit_image``), so that boxes are shares of the input's sides.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.inference.graph import Size
from pipeline.types import F32
from pipeline.vision.heads.decoder import BoxOutputs, Decoded, Decoder, Head

_CLASSES = 80
"""Labels are COCO class numbers, starting at 0."""


def decode(outputs: Sequence[F32], size: Size, floor: float) -> Decoded:
    """(1, N) integer labels, (1, N, 4) ``x1 y1 x2 y2`` as fractions of the image, (1, N) scores, in any order."""
    labels, boxes, scores = _parts(outputs)
    keep = (scores >= floor) & np.isfinite(boxes).all(axis=1)
    pixels = boxes[keep] * np.array([size[1], size[0], size[1], size[0]], np.float32)
    return pixels.astype(np.float32), scores[keep].astype(np.float32), labels[keep].astype(np.int64)


def _parts(outputs: Sequence[F32]) -> tuple[np.ndarray, F32, F32]:
    (boxes,) = (each[0] for each in outputs if each.ndim == 3)
    (labels,) = (each[0] for each in outputs if each.ndim == 2 and np.issubdtype(each.dtype, np.integer))
    (scores,) = (each[0] for each in outputs if each.ndim == 2 and np.issubdtype(each.dtype, np.floating))
    return labels, boxes, scores


def _three(answer: BoxOutputs) -> Decoder | None:
    try:
        labels, boxes, scores = _parts(answer.outputs)
    except ValueError:
        return None
    if not (boxes.shape[1:] == (4,) and len(labels) == len(boxes) == len(scores)):
        return None
    return Decoder("DETR", _CLASSES, True, 1 / 255, False, decode)


LABELS_BOXES_SCORES = Head("DETR", _three)
