"""Depth edges of the LiDAR, and the strength of image gradients at them.

Where a car ends and the road behind it begins, both sensors see an edge (Levinson and Thrun 2013, "Automatic Online
Calibration of Cameras and Lasers"). As in that paper, image edges are spread with an inverse distance transform, so
that a depth edge slightly off an image edge still matches it. Unlike there, only changes from left to right count,
because a depth edge along a ring is upright, and each is normalised by how busy the image is around it: a fence or a
tree is no better a match than the side of a car.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numba
import numpy as np

from pipeline.types import F32, F64, U8, Sweep

JUMP_M, JUMP_SHARE = 0.5, 0.05
"""If a neighbour on the ring is farther by this much and by this share of the range, there is a depth edge in
between."""
NEAREST_M, FARTHEST_M = 2.0, 50.0
WIDEST_STEP_RAD = np.radians(1.0)
"""If neighbours are farther apart, returns between them are missing, such as towards the sky: both are depth edges."""
SPREAD_WIDTHS = 0.0035
"""Distance from an image edge at which its strength falls to 1/e, in image widths: 4 px at 1280."""
AROUND_WIDTHS = 0.05
"""Size of the surroundings used to normalise an edge's strength, in image widths."""
FLAT = 20.0
"""A change of brightness (Sobel) up to this is camera noise."""
STRONGEST = 4.0
"""Maximum strength of an edge relative to its surroundings."""


@dataclass(frozen=True, eq=False)
class EdgeScene:
    """The parts of a frame that do not depend on the alignment."""

    points: F64
    """(E, 3) depth edges, ego frame, metres."""
    strength: U8
    """(H, W) uint8, proximity and strength of a vertical edge of the image."""
    usual: F32
    """(H,) the mean strength of each row."""


def edge_scene(sweep: Sweep, bgr: U8) -> EdgeScene:
    """bgr: (H, W, 3) uint8. Takes some 40 ms."""
    return scene_of(depth_edges(sweep), bgr)


def scene_of(points: F64, bgr: U8) -> EdgeScene:
    """Depth edges (E, 3) and an image (H, W, 3) uint8 that belong together."""
    strength = upright_edges(bgr)
    return EdgeScene(points, strength, strength.mean(axis=1, dtype=np.float32))


def depth_edges(sweep: Sweep) -> F64:
    """(E, 3) points ahead where a foreground object ends: the next return on the ring is far behind it, or missing."""
    ahead = sweep.points[:, 0] > 0.0
    xyz = sweep.points[ahead, :3].astype(np.float64)
    range_m, azimuth = np.hypot(xyz[:, 0], xyz[:, 1]), np.arctan2(xyz[:, 1], xyz[:, 0])
    order = np.lexsort((azimuth, sweep.ring[ahead]))
    xyz, range_m, azimuth, ring = xyz[order], range_m[order], azimuth[order], sweep.ring[ahead][order]
    step_m = np.diff(range_m)
    same, lost = np.diff(ring.astype(np.int16)) == 0, np.diff(azimuth) >= WIDEST_STEP_RAD
    nearer = np.minimum(range_m[:-1], range_m[1:])
    jumps = same & ~lost & (np.abs(step_m) > np.maximum(JUMP_M, JUMP_SHARE * nearer))
    at, gap = np.flatnonzero(jumps), np.flatnonzero(same & lost)
    border = np.concatenate([np.where(step_m[at] > 0, at, at + 1), gap, gap + 1])
    return xyz[border[(range_m[border] > NEAREST_M) & (range_m[border] < FARTHEST_M)]]


def upright_edges(bgr: U8) -> U8:
    """(H, W) uint8: horizontal changes of brightness, relative to their surroundings, spread to both sides."""
    width = bgr.shape[1]
    grey = cv2.GaussianBlur(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY), (5, 5), 0)
    change = np.abs(cv2.Sobel(grey, cv2.CV_32F, 1, 0))
    around = int(AROUND_WIDTHS * width) | 1
    relative = np.minimum(change / (FLAT + cv2.blur(change, (around, around))), STRONGEST)
    spread = np.ascontiguousarray(relative, dtype=np.float32)
    _spread(spread, np.float32(np.exp(-1.0 / (SPREAD_WIDTHS * width))))
    return np.round(spread * np.float32(255.0 / STRONGEST)).astype(np.uint8)


@numba.njit(cache=True, nogil=True)
def _spread(strength, keeps):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Raises each pixel to the maximum over the neighbours in its row, attenuated by this factor per step (inverse
    distance transform along rows). strength: (H, W) float32, changed in place."""
    for row in range(strength.shape[0]):
        reached = np.float32(0.0)
        for at in range(strength.shape[1]):
            reached = max(strength[row, at], reached * keeps)
            strength[row, at] = reached
        reached = np.float32(0.0)
        for at in range(strength.shape[1] - 1, -1, -1):
            reached = max(strength[row, at], reached * keeps)
            strength[row, at] = reached
