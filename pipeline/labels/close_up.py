"""A close-up of a label: the image around it, and its points from above, from the side and from behind.

It also measures how well a cuboid fits its points, which determines the frames to review first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.common.geometry import CUBOID_EDGES, Cuboid
from pipeline.labels.model import Sighting
from pipeline.types import F32, F64, U8, Frame

WIDTH_PX, HEIGHT_PX = 160, 110
"""Size of one of the four views."""
_BESIDE_M = 0.6
"""Points this close to a cuboid belong to its vehicle or to something beside it."""
_ROAD_M = 0.2
"""Points this close to its bottom may be road."""
_SHOWN_M = 1.5
"""Of the surroundings, around the cuboid."""
_IMAGE_MARGIN = 0.4
"""Share of the box shown around it in the image."""
_BACK, _POINT, _BESIDE, _EDGE, _TEXT = (24, 20, 17), (235, 225, 215), (90, 150, 255), (140, 220, 120), (190, 190, 190)
_VIEWS = (("top", 0, 1), ("side", 0, 2), ("rear", 1, 2))


@dataclass(frozen=True)
class Fit:
    """How well a cuboid fits the points around it. Road points are not counted."""

    inside: int
    """Points in the cuboid."""
    beside: int
    """Points directly outside it: many mean that it is too small or misplaced."""

    @property
    def share_beside(self) -> float | None:
        """0 if all points are inside; None without points."""
        count = self.inside + self.beside
        return self.beside / count if count else None


def fit_of(points: F32, cuboid: Cuboid) -> Fit:
    """points: (N, 4) float32 ``x y z intensity``, ego frame."""
    own = _in_own_frame(points, cuboid)
    half = np.array(cuboid.size) / 2
    is_high = own[:, 2] > -half[2] + _ROAD_M
    near = is_high & np.all(np.abs(own) <= half + _BESIDE_M, axis=1)
    inside = int((near & np.all(np.abs(own) <= half + 0.02, axis=1)).sum())
    return Fit(inside, int(near.sum()) - inside)


def close_up(frame: Frame, sighting: Sighting, alignment: Alignment | None) -> U8:
    """(2·HEIGHT_PX, 2·WIDTH_PX, 3) BGR: image, top and, below, side and rear view. Views without data stay empty. Of a
    label without a cuboid, only the image: (HEIGHT_PX, WIDTH_PX, 3). alignment: projection of points into the image;
    None if unknown."""
    views = [_in_image(frame, sighting, alignment)]
    if sighting.cuboid is None:
        return views[0]
    points = frame.sweep.points if frame.sweep is not None else None
    views += [_projected(name, points, sighting.cuboid, across, up) for name, across, up in _VIEWS]
    return np.vstack([np.hstack(views[:2]), np.hstack(views[2:])])


def _in_own_frame(points: F32, cuboid: Cuboid) -> F64:
    """(N, 3) metres relative to the centre of the cuboid, along its length, width and height."""
    c, s = math.cos(cuboid.yaw_rad), math.sin(cuboid.yaw_rad)
    away = points[:, :3].astype(np.float64) - cuboid.center
    return np.column_stack([c * away[:, 0] + s * away[:, 1], c * away[:, 1] - s * away[:, 0], away[:, 2]])


def _projected(name: str, points: F32 | None, cuboid: Cuboid, across: int, up: int) -> U8:
    """The points around a cuboid in a plane of two of its axes: length to the right and width or height up; in the rear
    view, the left side is on the left."""
    view = _empty(name)
    half = np.array(cuboid.size) / 2
    scale = min(WIDTH_PX / 2 / (half[across] + _SHOWN_M), HEIGHT_PX / 2 / (half[up] + _SHOWN_M))
    turn = -1.0 if across == 1 else 1.0
    own = _in_own_frame(points, cuboid) if points is not None else np.empty((0, 3))
    own = own[np.all(np.abs(own) <= half + _SHOWN_M, axis=1)]
    is_inside = np.all(np.abs(own) <= half + 0.02, axis=1)
    u = np.rint(WIDTH_PX / 2 + turn * own[:, across] * scale).astype(int)
    v = np.rint(HEIGHT_PX / 2 - own[:, up] * scale).astype(int)
    for x, y, inside in zip(u.tolist(), v.tolist(), is_inside.tolist(), strict=True):
        cv2.circle(view, (x, y), 1, _POINT if inside else _BESIDE, -1)
    corner = np.array([half[across], half[up]]) * scale
    low, high = np.array([WIDTH_PX, HEIGHT_PX]) / 2 - corner, np.array([WIDTH_PX, HEIGHT_PX]) / 2 + corner
    cv2.rectangle(view, np.rint(low).astype(int).tolist(), np.rint(high).astype(int).tolist(), _EDGE, 1)
    if across == 0:  # its front is to the right
        cv2.line(view, (WIDTH_PX // 2, HEIGHT_PX // 2), (round(high[0]), HEIGHT_PX // 2), _EDGE, 1)
    return view


def _in_image(frame: Frame, sighting: Sighting, alignment: Alignment | None) -> U8:
    view = _empty("image")
    pixels = None
    if sighting.cuboid is not None and alignment is not None:
        pixels = alignment.project(sighting.cuboid.corners())
        pixels = None if np.isnan(pixels).any() else pixels
    if frame.image is None or (pixels is None and sighting.bbox is None):
        return view
    around = pixels if pixels is not None else np.array(sighting.bbox).reshape(2, 2)
    low, high = around.min(axis=0), around.max(axis=0)
    middle, half = (low + high) / 2, (high - low) / 2 * (1.0 + _IMAGE_MARGIN)
    scale = min(WIDTH_PX / 2 / max(half[0], 4.0), HEIGHT_PX / 2 / max(half[1], 4.0))
    onto = np.array([[scale, 0.0, WIDTH_PX / 2 - scale * middle[0]], [0.0, scale, HEIGHT_PX / 2 - scale * middle[1]]])
    shown = cv2.warpAffine(frame.image.bgr, onto, (WIDTH_PX, HEIGHT_PX), flags=cv2.INTER_LINEAR, borderValue=_BACK)
    if pixels is not None:
        at = np.rint(pixels * scale + onto[:, 2]).astype(int)
        for a, b in CUBOID_EDGES:
            cv2.line(shown, at[a].tolist(), at[b].tolist(), _EDGE, 1, cv2.LINE_AA)
    elif sighting.bbox is not None:
        ends = np.rint(around * scale + onto[:, 2]).astype(int)
        cv2.rectangle(shown, ends[0].tolist(), ends[1].tolist(), _EDGE, 1)
    return np.asarray(shown, dtype=np.uint8)


def _empty(name: str) -> U8:
    view = np.full((HEIGHT_PX, WIDTH_PX, 3), _BACK, dtype=np.uint8)
    cv2.putText(view, name, (4, HEIGHT_PX - 5), cv2.FONT_HERSHEY_SIMPLEX, 0.35, _TEXT, 1, cv2.LINE_AA)
    return view
