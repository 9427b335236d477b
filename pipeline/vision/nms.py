"""From a detector's raw candidates to detections: score threshold and non-maximum suppression.

Kept apart from the network, so that moving a slider never runs it again.
"""

from __future__ import annotations

import numpy as np

from pipeline.common.geometry import iou_matrix
from pipeline.params import DetectionParams
from pipeline.types import VEHICLES, Detection, RawBoxes
from pipeline.vision.classes import NOT_ON_ROADS, SEEN_AS


def select(raw: RawBoxes, params: DetectionParams) -> tuple[Detection, ...]:
    """Detections by descending score (ties: the detector's order).

    Boxes of one class suppress each other, and so do boxes of all vehicle classes: candidates labelled car and truck at
    one place are one object. Its box and score are those of the best candidate, its class is decided by ``_name``.
    """
    raw = raw if params.far_view else raw.without_far()
    candidates = np.flatnonzero(raw.scores >= params.min_score)
    if params.road_users_only:
        candidates = np.array([k for k in candidates.tolist() if raw.labels[k] not in NOT_ON_ROADS], dtype=np.intp)
    order = candidates[np.argsort(-raw.scores[candidates], kind="stable")]
    boxes, scores = raw.boxes[order], raw.scores[order].tolist()
    labels = [SEEN_AS.get(raw.labels[index], raw.labels[index]) for index in order.tolist()]
    kinds = ["vehicle" if label in VEHICLES else label for label in labels]
    number = {kind: k for k, kind in enumerate(dict.fromkeys(kinds))}
    kind = np.array([number[each] for each in kinds], dtype=np.int64)
    same = (iou_matrix(boxes, boxes) > params.nms_iou) & (kind[:, None] == kind)
    alive = np.ones(len(order), dtype=np.bool_)
    found = []
    for best, (x1, y1, x2, y2) in enumerate(boxes.tolist()):
        if alive[best]:
            suppressed = alive & same[best]
            suppressed[best] = True
            alive &= ~suppressed
            members = [(labels[k], scores[k]) for k in np.flatnonzero(suppressed).tolist()]
            found.append(Detection((x1, y1, x2, y2), _name(members, params.car_prior), scores[best]))
    return tuple(found)


def _name(members: list[tuple[str, float]], car_prior: float) -> str:
    """Class of one object from its candidates, best first: the best candidate's class, except that a vehicle is a car
    unless the other class scores ``car_prior`` times as high as the car candidate. Cars are more common on roads than
    in COCO, from which the network learned its prior, and a car classified as a bus is placed at twice its distance."""
    label, score = members[0]
    as_car = max((each for name, each in members if name == "car"), default=0.0)
    return "car" if label in VEHICLES and as_car * car_prior > score else label
