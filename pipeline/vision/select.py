"""From a detector's raw candidates to detections: score threshold and non-maximum suppression.

Kept apart from the network, so that moving a slider never runs it again.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.geometry import iou_matrix
from pipeline.params import DetectionParams
from pipeline.types import VEHICLES, Detection, RawBoxes


def select(raw: RawBoxes, params: DetectionParams) -> tuple[Detection, ...]:
    """Detections by falling score (ties: the detector's order).

    Boxes of one class suppress each other, and so do all vehicle classes: what the network calls car in one candidate
    and truck in the next is one object. Its box and score are the best candidate's, its name as ``_name`` decides.
    """
    candidates = np.flatnonzero(raw.scores >= params.min_score)
    order = candidates[np.argsort(-raw.scores[candidates], kind="stable")]
    kinds = np.array(["vehicle" if raw.labels[index] in VEHICLES else raw.labels[index] for index in order])
    same = (iou_matrix(raw.boxes[order], raw.boxes[order]) > params.nms_iou) & (kinds[:, None] == kinds[None, :])
    alive = np.ones(len(order), dtype=bool)
    found = []
    for best in range(len(order)):
        if alive[best]:
            suppressed = alive & same[best]
            suppressed[best] = True
            alive &= ~suppressed
            found.append(_detection(raw, order[suppressed], params.car_prior))
    return tuple(found)


def _detection(raw: RawBoxes, members: npt.NDArray[np.intp], car_prior: float) -> Detection:
    """One object from its candidates, best first."""
    best = int(members[0])
    x1, y1, x2, y2 = (float(value) for value in raw.boxes[best])
    return Detection((x1, y1, x2, y2), _name(raw, members, car_prior), float(raw.scores[best]))


def _name(raw: RawBoxes, members: npt.NDArray[np.intp], car_prior: float) -> str:
    """The best candidate's class, except that a vehicle is a car unless the other class scores ``car_prior`` times the
    car candidate: on a road cars are commoner than in COCO, on which the network learned how common they are, and
    a car taken for a bus is placed twice as far away as it is."""
    label, score = raw.labels[members[0]], float(raw.scores[members[0]])
    as_car = max((float(raw.scores[index]) for index in members if raw.labels[index] == "car"), default=0.0)
    return "car" if label in VEHICLES and as_car * car_prior > score else label
