"""Assigns the boxes of an image to tracked objects (paper, Algorithm 1): one-to-one, with the least total
dissimilarity."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.common.geometry import F64, iou_matrix
from pipeline.params import VisionTrackingParams
from pipeline.types import VEHICLES, VisionMeasurement, VisionTrack

_NOMINAL_DT_S = 0.1
_MAX_GROWTH = 3.0
"""The outer gate is tuned for images 0.1 s apart; it widens with the time since the last sighting, by this factor at
most."""
_DOUBLE_IOU = 0.25
"""A new box that overlaps a tracked one by more is its double, or one of the two vehicles mostly hides the other. With
an overlap between this and ``detection.nms_iou``, YOLOX-nano draws a second box on 2.6 % of clearly visible
vehicles (``pipeline.experiments.robustness.measure``)."""
_ESTABLISHED_HITS = 3
"""Number of sightings after which an object's motion is measured instead of assumed."""


class Expected(NamedTuple):
    """A tracked object, predicted to the current image."""

    track: VisionTrack
    """With the predicted box."""
    centre_sigma_px: float
    """Standard deviation of a measured centre from the predicted one, along each axis of the image."""
    noise_px: float
    """The part of it due to the box's own noise, which remains even with a perfect prediction."""
    unseen_s: float
    """Time since its last sighting."""
    double_of: int | None = None
    """Id of the object on which its first box lay; None if it lay on none."""


def match(
    expected: Sequence[Expected],
    measurements: Sequence[VisionMeasurement],
    params: VisionTrackingParams,
) -> dict[int, int]:
    """Index of tracked object → index of measurement. If a network draws a second box on a vehicle, this starts a
    duplicate track. So that it cannot take the vehicle's only box, duplicates choose last among the remaining boxes.
    """
    if params.filter == "queue":
        return _assign(range(len(expected)), range(len(measurements)), expected, measurements, params)
    doubles = _doubles(expected)
    first = [row for row in range(len(expected)) if row not in doubles]
    found = _assign(first, range(len(measurements)), expected, measurements, params)
    taken = set(found.values())
    left = [column for column in range(len(measurements)) if column not in taken]
    return found | _assign(sorted(doubles), left, expected, measurements, params)


def first_box_on(boxes: Sequence[VisionMeasurement], tracks: Sequence[VisionTrack]) -> list[int | None]:
    """For each first box of a new object: the id of the established object that it lies on, or None."""
    old = [track for track in tracks if track.hits >= _ESTABLISHED_HITS]
    if not old or not boxes:
        return [None] * len(boxes)
    overlap = iou_matrix(np.array([each.detection.bbox for each in boxes]), np.array([track.bbox for track in old]))
    best = overlap.argmax(axis=1).tolist()
    return [old[k].id if overlap[row, k] > _DOUBLE_IOU else None for row, k in enumerate(best)]


def _doubles(expected: Sequence[Expected]) -> set[int]:
    """Objects that began on an established one, for as long as they overlap it. Some networks draw two boxes on a
    vehicle for seconds, so the number of sightings does not make such an object another vehicle; leaving it does."""
    row_of = {each.track.id: row for row, each in enumerate(expected)}
    pairs = [(row, row_of[each.double_of]) for row, each in enumerate(expected) if each.double_of in row_of]
    if not pairs:
        return set()
    boxes = np.array([each.track.bbox for each in expected])
    return {young for young, old in pairs if iou_matrix(boxes[[young]], boxes[[old]])[0, 0] > _DOUBLE_IOU}


def _assign(
    rows: Sequence[int],
    columns: Sequence[int],
    expected: Sequence[Expected],
    measurements: Sequence[VisionMeasurement],
    params: VisionTrackingParams,
) -> dict[int, int]:
    """The one-to-one assignment of least total cost, where an unmatched pair costs as much as a pair at its gate.
    (Maximising the number of pairs would shift a whole row of cars by one when the first leaves the image.)"""
    if not rows or not columns:
        return {}
    cost = _costs([expected[row] for row in rows], [measurements[column] for column in columns], params)
    chosen = zip(*(each.tolist() for each in linear_sum_assignment(np.minimum(cost, 1.0))), strict=True)
    return {rows[i]: columns[j] for i, j in chosen if cost[i, j] < 1.0}


def same_kind(a: str, b: str) -> bool:
    """Whether two class names may belong to the same object: detectors confuse vehicle classes, but not a person with a
    car."""
    return a == b or VEHICLES.issuperset((a, b))


def _costs(
    expected: Sequence[Expected],
    measurements: Sequence[VisionMeasurement],
    params: VisionTrackingParams,
) -> F64:
    """(n, m) cost of each pair of box and prediction: 0 for equal, 1 at the gate, infinite for another kind of object.

    queue: distance of the centres (in print: of the half widths). kalman: Mahalanobis distance of the centre, plus
    changes of width and height. The gate scales with the uncertainty of the prediction, so that a small box far away,
    which moves by two or three pixels, cannot be confused with its neighbour 20 pixels aside: a new id is better than a
    wrong one. If a detector briefly draws half of a vehicle, the vehicle keeps its id; the place filter rejects the
    resulting distance. With a vague prediction any box nearby has a small Mahalanobis distance, but no box has a high
    likelihood. The logarithm of the spread is therefore added to the cost, as in a likelihood, which also narrows the
    gate.
    """
    old = np.array([each.track.bbox for each in expected])
    new = np.array([seen.detection.bbox for seen in measurements])
    apart = (old[:, None, :2] + old[:, None, 2:] - new[:, :2] - new[:, 2:]) / 2
    moved_px = np.hypot(apart[..., 0], apart[..., 1])
    if params.filter == "queue":
        cost = moved_px / params.gate_px
    else:
        sigma_px = np.array([each.centre_sigma_px for each in expected])[:, None]
        old_size, new_size = old[:, 2:] - old[:, :2], new[:, 2:] - new[:, :2]
        change = np.abs(np.log(np.maximum(new_size, 1.0) / np.maximum(old_size, 1.0)[:, None]))
        vague = np.array([math.log(each.centre_sigma_px / each.noise_px) for each in expected])[:, None]
        cost = np.sqrt(
            ((moved_px / sigma_px) ** 2 + 4.0 * vague) / params.gate_sigmas**2
            + (change.max(axis=-1) / math.log(params.max_size_ratio)) ** 2
        )
        growth = np.clip([each.unseen_s / _NOMINAL_DT_S for each in expected], 1.0, _MAX_GROWTH)
        farthest_px = np.maximum(params.gate_px, params.gate_sizes * old_size[:, 0]) * growth
        cost = np.where(moved_px < farthest_px[:, None], cost, np.inf)
    named = [seen.detection.label for seen in measurements]
    return np.where([[same_kind(each.track.label, name) for name in named] for each in expected], cost, np.inf)
