"""Agreement of two people who labelled the same recording independently."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.labels.model import COUNTED_STATES, LabelSet, LabelTrack, Lead

_SAME_IOU = 0.1
"""Two cuboids with a smaller overlap, seen from above, are different vehicles."""


@dataclass(frozen=True)
class Agreement:
    """Agreement of two label sets. Shares are None if there is nothing to compare."""

    frames: int
    """Number of frames in which both have a lead label."""
    lead_share: float | None
    """Share of these in which both give the same vehicle, both none, or both unclear."""
    lead_disagreements: tuple[int, ...]
    """The frames in which they differ."""
    vehicles: int
    """Cuboids that both have, frame by frame."""
    only_first: int
    """Cuboids that only the first set has, in frames in which both have some."""
    only_second: int
    """Cuboids that only the second set has, in the same frames."""
    iou: float | None
    """Median overlap of the cuboids that both have, seen from above."""
    class_share: float | None
    """Share of these to which both give the same class."""
    reversed_share: float | None
    """Share of these with opposite headings."""


def agreement(first: LabelSet, second: LabelSet) -> Agreement:
    """Compare two label sets. Raises BadInput if they are of different recordings."""
    if first.t_ns != second.t_ns:
        raise BadInput("the two label sets are of different recordings")
    ours, theirs = _by_frame(first), _by_frame(second)
    overlaps: list[float] = []
    same_class = reversed_count = alone_first = alone_second = 0
    partners: dict[int, dict[int, int]] = {}
    for frame in sorted(ours.keys() & theirs.keys()):
        both_have = pairs([each[1] for each in ours[frame]], [each[1] for each in theirs[frame]])
        for a, b, iou in both_have:
            (one, cuboid), (other, opposite) = ours[frame][a], theirs[frame][b]
            overlaps.append(iou)
            same_class += one.label == other.label
            reversed_count += math.cos(cuboid.yaw_rad - opposite.yaw_rad) < 0
            partners.setdefault(frame, {})[one.id] = other.id
        alone_first += len(ours[frame]) - len(both_have)
        alone_second += len(theirs[frame]) - len(both_have)
    leads, others = _leads(first), _leads(second)
    both = sorted(leads.keys() & others.keys())
    apart = tuple(frame for frame in both if not _is_same(leads[frame], others[frame], partners.get(frame, {})))
    count = len(overlaps)
    return Agreement(
        len(both),
        1.0 - len(apart) / len(both) if both else None,
        apart,
        count,
        alone_first,
        alone_second,
        median(overlaps) if overlaps else None,
        same_class / count if count else None,
        reversed_count / count if count else None,
    )


def bev_iou(a: Cuboid, b: Cuboid) -> float:
    """Intersection over union of two footprints."""
    (one, other) = (((c.center[0], c.center[1]), c.size[:2], math.degrees(c.yaw_rad)) for c in (a, b))
    _, corners = cv2.rotatedRectangleIntersection(one, other)
    both = float(cv2.contourArea(cv2.convexHull(corners))) if corners is not None else 0.0
    return both / (a.size[0] * a.size[1] + b.size[0] * b.size[1] - both)


def _is_same(ours: Lead, theirs: Lead, partners: Mapping[int, int]) -> bool:
    if isinstance(ours, int) and isinstance(theirs, int):
        return partners.get(ours) == theirs
    return ours == theirs


def pairs(ours: list[Cuboid], theirs: list[Cuboid]) -> list[tuple[int, int, float]]:
    """Matching cuboids, one-to-one, with their overlap."""
    overlaps = np.array([[bev_iou(a, b) for b in theirs] for a in ours])
    rows, columns = linear_sum_assignment(np.where(overlaps >= _SAME_IOU, overlaps, 0.0), maximize=True)
    return [
        (int(a), int(b), float(overlaps[a, b]))
        for a, b in zip(rows, columns, strict=True)
        if overlaps[a, b] >= _SAME_IOU
    ]


def _by_frame(labels: LabelSet) -> dict[int, list[tuple[LabelTrack, Cuboid]]]:
    found: dict[int, list[tuple[LabelTrack, Cuboid]]] = {}
    for track in labels.tracks:
        if track.state in COUNTED_STATES:
            for each in track.sightings:
                if each.cuboid is not None:
                    found.setdefault(each.frame, []).append((track, each.cuboid))
    return found


def _leads(labels: LabelSet) -> dict[int, Lead]:
    return {
        frame: each.lead
        for each in labels.leads
        if each.state in COUNTED_STATES
        for frame in range(each.first, each.last + 1)
    }
