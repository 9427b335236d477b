"""Cars cut out of Astyx's images along their outlines."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np

from pipeline.alignment.projection import resolve
from pipeline.common.files.data_dir import data_dir
from pipeline.common.geometry import Cuboid
from pipeline.params import AlignmentParams
from pipeline.sources import open_source
from pipeline.types import U8, Box

CARS = {
    "SUV": ("astyx", "000190"),
    "small car": ("astyx", "000065"),
    "van": ("astyx", "000425"),
    "oncoming SUV": ("astyx_more", "000375"),
}
"""Folder and frame of each: the nearest labelled car straight ahead. The last one shows its front."""
_BESIDE_M, _FARTHEST_M = 2.2, 26.0
_MARGIN = 0.3
"""Surroundings cut out with it, as a share of its width: what the background looks like."""
_LOOSE_PX = 8
"""A labelled box is this inaccurate."""
_SURE = ((0.15, 0.35, 0.85, 0.8), (0.28, 0.1, 0.72, 0.4))
"""Parts of the box, as shares x1 y1 x2 y2, that every car fills: its body and its rear window."""
_ROUNDS = 6


class CutOut(NamedTuple):
    """A car seen from behind or ahead."""

    bgr: U8
    """(h, w, 3), cut off at its outline's extent."""
    mask: U8
    """(h, w), 1 on the car."""
    size: tuple[float, float, float]
    """Its labelled length, width and height, metres."""


@cache
def cut_out(name: str) -> CutOut:
    """A car of ``CARS``."""
    folder, frame_name = CARS[name]
    source = open_source(f"astyx:{data_dir() / folder}")
    index = next(each.index for each in source.outlines() if each.name == frame_name)
    frame = source.frame(index)
    ahead = [each.cuboid for each in source.truth(index) or () if _is_ahead(each.cuboid)]
    car = min(ahead, key=lambda cuboid: cuboid.center[0])
    aligned = resolve(AlignmentParams(), frame.camera)
    assert frame.image is not None
    assert aligned is not None
    nearest = sorted(car.corners(), key=lambda corner: corner[0])[:4]
    uv = aligned.project(np.array(nearest))
    return _along_its_outline(frame.image.bgr, (*uv.min(axis=0).tolist(), *uv.max(axis=0).tolist()), car.size)


def _is_ahead(cuboid: Cuboid) -> bool:
    return abs(cuboid.center[1]) < _BESIDE_M and 0.0 < cuboid.center[0] < _FARTHEST_M


def _along_its_outline(bgr: U8, box: Box, size: tuple[float, float, float]) -> CutOut:
    """GrabCut (Rother, Kolmogorov and Blake 2004) between what certainly is the car and its surroundings."""
    x1, y1, x2, y2 = (round(each) for each in box)
    margin = round(_MARGIN * (x2 - x1))
    part = bgr[y1 - margin : y2 + margin, x1 - margin : x2 + margin].copy()
    mask = np.full(part.shape[:2], cv2.GC_BGD, np.uint8)
    inner, outer = margin - _LOOSE_PX, margin + _LOOSE_PX
    mask[inner : y2 - y1 + outer, inner : x2 - x1 + outer] = cv2.GC_PR_FGD
    for left, top, right, bottom in _SURE:
        rows = slice(margin + round(top * (y2 - y1)), margin + round(bottom * (y2 - y1)))
        mask[rows, margin + round(left * (x2 - x1)) : margin + round(right * (x2 - x1))] = cv2.GC_FGD
    cv2.setRNGSeed(0)
    cv2.grabCut(part, mask, None, np.zeros((1, 65)), np.zeros((1, 65)), _ROUNDS, cv2.GC_INIT_WITH_MASK)
    found = np.isin(mask, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.uint8)
    found = cv2.morphologyEx(cv2.morphologyEx(found, cv2.MORPH_CLOSE, np.ones((9, 9))), cv2.MORPH_OPEN, np.ones((7, 7)))
    _, parts, stats, _ = cv2.connectedComponentsWithStats(found)
    largest = 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
    left, top, width, height = stats[largest, :4].tolist()
    rows, columns = slice(top, top + height), slice(left, left + width)
    return CutOut(part[rows, columns], (parts[rows, columns] == largest).astype(np.uint8), size)
