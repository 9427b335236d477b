"""How well LiDAR and pictures lie on each other: do jumps in depth fall on edges of the picture?

Where a car ends and the road behind it begins, both sensors see a border (Levinson and Thrun 2013, "Automatic Online
Calibration of Cameras and Lasers"). A busy picture has edges everywhere, so the share of depth edges that lie on one is
set against the share that points placed at random in the same rows would have.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from pipeline.alignment import Alignment
from pipeline.types import F64, U8, Sweep

JUMP_M, JUMP_SHARE = 0.5, 0.05
"""A neighbour on the ring that is this much farther, and by this share of the range, is behind a border."""
NEAREST_M, FARTHEST_M = 2.0, 50.0
WIDEST_STEP_RAD = np.radians(1.0)
"""Neighbours farther apart than this have returns that were lost between them, as against the sky: both are borders."""
NEAR_WIDTHS = 0.003
"""An edge this near, in picture widths, is met: 4 px at 1280."""
FEWEST = 30


@dataclass(frozen=True)
class EdgeScore:
    """score: 1 when every depth edge lies on one of the picture, 0 when no more than by chance (below it is 0 too).
    median_px: from a depth edge to the nearest edge of the picture. pairs: depth edges in the picture. Null where there
    are too few to say."""

    score: float | None
    median_px: float | None
    pairs: int


@dataclass(frozen=True, eq=False)
class EdgeScene:
    """What of one frame no alignment changes. points: (E, 3) depth edges. away_px: (H, W) uint8 to the nearest edge of
    the picture, 255 for more."""

    points: F64
    away_px: U8


def edge_scene(sweep: Sweep, bgr: U8) -> EdgeScene:
    """bgr: (H, W, 3) uint8. Some 40 ms; scoring it afterwards is far below one."""
    return EdgeScene(depth_edges(sweep), edge_distances(bgr))


def edge_score(scenes: Iterable[tuple[EdgeScene, Alignment]]) -> EdgeScore:
    """The score over several frames, each under its alignment: a single sweep of 16 rings has few borders."""
    met: list[F64] = []
    by_chance: list[F64] = []
    for scene, aligned in scenes:
        height, width = scene.away_px.shape
        pixels = aligned.project(scene.points)
        with np.errstate(invalid="ignore"):
            seen = np.all((pixels >= 0) & (pixels < [width, height]), axis=1)
        u, v = pixels[seen].astype(np.intp).T
        near_px = NEAR_WIDTHS * width
        met.append(np.column_stack([scene.away_px[v, u], np.full(len(u), near_px)]))
        by_chance.append((scene.away_px[v] <= near_px).mean(axis=1))
    distances = np.concatenate(met) if met else np.zeros((0, 2))
    if len(distances) < FEWEST:
        return EdgeScore(None, None, len(distances))
    share, chance = float(np.mean(distances[:, 0] <= distances[:, 1])), float(np.mean(np.concatenate(by_chance)))
    score = max(0.0, (share - chance) / max(1.0 - chance, 1e-6))
    return EdgeScore(round(score, 4), float(np.median(distances[:, 0])), len(distances))


def depth_edges(sweep: Sweep) -> F64:
    """(E, 3) points ahead at which something in front ends: the next return on the ring is far behind, or lost."""
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


def edge_distances(bgr: U8) -> U8:
    """(H, W) uint8 pixels to the nearest edge of the picture (Canny 1986), 255 for more."""
    grey = cv2.GaussianBlur(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY), (5, 5), 0)
    edges = cv2.Canny(grey, 60, 150)
    return np.clip(cv2.distanceTransform(255 - edges, cv2.DIST_L2, 3), 0, 255).astype(np.uint8)
