"""Which boxes of an image are of something nearer than others, by the boxes alone."""

from __future__ import annotations

from pipeline.common.geometry import F64, iou_matrix
from pipeline.types import Mask

EDGE_PX = 2.0
"""Standard deviation of a box's lower edge from image to image."""
_SAME_IOU = 0.5
"""Boxes that overlap by more than this are of the same vehicle."""


def nearer(bbox: F64) -> Mask:
    """(M, M) whether the second of two boxes (M, 4) is of something nearer than the first: on a level road, what is
    nearer ends farther down. Two boxes on one vehicle are equally near."""
    y2 = bbox[:, 3:]
    found: Mask = (y2 + EDGE_PX < y2.T) & (iou_matrix(bbox, bbox) < _SAME_IOU)
    return found
