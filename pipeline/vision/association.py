"""Which followed object each box of a picture is (paper, Algorithm 1): one-to-one, the least unlike of all choices."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.common.geometry import F64
from pipeline.params import VisionTrackingParams
from pipeline.types import VEHICLES, VisionMeasurement, VisionTrack

_NOMINAL_DT_S = 0.1
_MAX_GROWTH = 3.0
"""The pixel gate is meant for pictures 0.1 s apart; it widens with the time since the last sighting, thrice at most."""


def match(
    expected: Sequence[VisionTrack],
    unseen_s: Sequence[float],
    measurements: Sequence[VisionMeasurement],
    params: VisionTrackingParams,
) -> dict[int, int]:
    """Index of followed object → index of measurement: the one-to-one choice of least total cost, where leaving a pair
    apart costs as much as a pair at its gate. (Making as many pairs as possible would shift a whole row of cars by one
    when the first leaves the picture.) unseen_s: since the last sighting of each."""
    if not expected or not measurements:
        return {}
    cost = _costs(expected, unseen_s, measurements, params)
    rows, columns = linear_sum_assignment(np.minimum(cost, 1.0))
    near = cost[rows, columns] < 1.0
    return dict(zip(rows[near].tolist(), columns[near].tolist(), strict=True))


def same_kind(a: str, b: str) -> bool:
    """Whether two names may be one object's: a detector mixes up vehicles, not a person and a car."""
    return a == b or VEHICLES.issuperset((a, b))


def _costs(
    expected: Sequence[VisionTrack],
    unseen_s: Sequence[float],
    measurements: Sequence[VisionMeasurement],
    params: VisionTrackingParams,
) -> F64:
    """(n, m) how unlike each box is to each expected one: 0 the same, 1 at the gate, infinite for another kind.

    queue: distance of the centres (print: of the half widths). kalman: also how much the width changed."""
    old = np.array([track.bbox for track in expected])
    new = np.array([seen.detection.bbox for seen in measurements])
    apart = (old[:, None, :2] + old[:, None, 2:] - new[:, :2] - new[:, 2:]) / 2
    moved_px = np.hypot(apart[..., 0], apart[..., 1])
    if params.filter == "queue":
        cost = moved_px / params.gate_px
    else:
        old_width, new_width = old[:, 2] - old[:, 0], new[:, 2] - new[:, 0]
        growth = np.clip(np.array(unseen_s) / _NOMINAL_DT_S, 1.0, _MAX_GROWTH)
        moved = moved_px / (np.maximum(params.gate_px, params.gate_sizes * old_width) * growth)[:, None]
        ratio = np.maximum(new_width, 1.0) / np.maximum(old_width, 1.0)[:, None]
        size = np.abs(np.log(ratio)) / math.log(params.max_size_ratio)
        cost = np.hypot(moved, size)
        # a gate that has grown lets in more, but what is far is no nearer for it: nobody else's box is taken
        cost = np.where(cost < 1.0, np.minimum(np.hypot(moved * growth[:, None], size), 0.99), cost)
    named = [seen.detection.label for seen in measurements]
    return np.where([[same_kind(track.label, name) for name in named] for track in expected], cost, np.inf)
