"""From a detector's raw candidates to detections: score threshold and non-maximum suppression.

Kept apart from the network, so that moving either slider never runs it again.
"""

from __future__ import annotations

import numpy as np

from pipeline.geometry import iou_matrix
from pipeline.params import DetectionParams
from pipeline.types import VEHICLES, Detection, RawBoxes


def select(raw: RawBoxes, params: DetectionParams) -> tuple[Detection, ...]:
    """Detections by falling score (ties: the detector's order). Boxes of one class suppress each other, and so do all
    vehicle classes: a van that the network calls car and truck is one object, under its better name."""
    candidates = np.flatnonzero(raw.scores >= params.min_score)
    order = candidates[np.argsort(-raw.scores[candidates], kind="stable")]
    kinds = np.array(["vehicle" if raw.labels[index] in VEHICLES else raw.labels[index] for index in order])
    overlapping = (iou_matrix(raw.boxes[order], raw.boxes[order]) > params.nms_iou) & (kinds[:, None] == kinds[None, :])
    alive = np.ones(len(order), dtype=bool)
    for best in range(len(order)):
        if alive[best]:
            alive[best + 1 :] &= ~overlapping[best, best + 1 :]
    return tuple(_detection(raw, int(index)) for index in order[alive])


def _detection(raw: RawBoxes, index: int) -> Detection:
    x1, y1, x2, y2 = (float(value) for value in raw.boxes[index])
    return Detection((x1, y1, x2, y2), raw.labels[index], float(raw.scores[index]))
