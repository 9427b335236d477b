"""Objects that the camera should have seen in this frame, but that no box covers.

An object is not asked about when the camera cannot know: no detector ran, the object is outside the image or cut by its
edge, another box covers it (which may hide it or belong to it), or, for an object that only the LiDAR sees, it is too
far or too small in the image, or nothing at all was boxed in it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.common.geometry import covered_share
from pipeline.types import Frame, FusedObject

_HIDDEN_SHARE = 0.3
"""If more of a box is hidden by other boxes, a network may miss the vehicle, so a missing box is no evidence."""
_SURE_M, _SURE_PX = 40.0, 25.0
"""Distance up to which, and height in the image from which a network finds a car almost always: 144 of 157 labelled
vehicles with a cluster on Astyx and KITTI were boxed at once, but 8 of 13 at 40 to 50 m. A car at 40 m is 27 pixels
high in KITTI's images."""
_CAR_HEIGHT_M = 1.5
"""The usual height of a car, for the distance at which it is ``_SURE_PX`` high."""


def missing_boxes(objects: Sequence[FusedObject], frame: Frame) -> frozenset[int]:
    """Ids of the objects that only the camera tracks and that it should have boxed again."""
    return _uncovered([each for each in objects if not each.ranged and not each.seen_by_camera], objects, frame)


def never_boxed(objects: Sequence[FusedObject], frame: Frame) -> frozenset[int]:
    """Ids of the objects without a class that the LiDAR sees, although the camera must have seen what they are. None in
    an image without any box: it may be dark, or the lens covered."""
    if frame.camera is None or not any(each.seen_by_camera for each in objects):
        return frozenset()
    reach_m = min(_SURE_M, float(frame.camera.K[1, 1]) * _CAR_HEIGHT_M / _SURE_PX)
    asked = [
        each
        for each in objects
        if each.seen_by_lidar and not each.imaged and each.distance_m is not None and each.distance_m <= reach_m
    ]
    return _uncovered(asked, objects, frame, margin_px=1.0)


def _uncovered(
    asked: Sequence[FusedObject], objects: Sequence[FusedObject], frame: Frame, margin_px: float = 0.0
) -> frozenset[int]:
    """Ids of those whose box lies in the image, with no box that was seen in this frame on much of it. margin_px: to
    the image's edge; the box of a cluster is clipped there, so without one it always lies in the image."""
    placed = [each for each in asked if each.bbox is not None]
    size = frame.image_size
    if not placed or size is None:
        return frozenset()
    boxes = np.array([each.bbox for each in placed])
    low, high = boxes[:, :2].min(axis=1), (np.array(size) - boxes[:, 2:]).min(axis=1)
    open_to_view = (low >= margin_px) & (high >= margin_px)
    seen = [each.bbox for each in objects if each.seen_by_camera and each.bbox is not None]
    if seen:
        open_to_view &= covered_share(boxes, np.array(seen)).max(axis=1) < _HIDDEN_SHARE
    return frozenset(placed[index].id for index in np.flatnonzero(open_to_view).tolist())
