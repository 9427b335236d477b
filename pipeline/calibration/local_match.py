"""Shows where LiDAR and images mismatch: by image region and by distance, over several frames at once.

The depth edges in a region are shifted over the images by some pixels in all directions. If they match clearly better
after one shift than after most others, that shift is the region's arrow; if no shift stands out, the region gives none.
Yaw and pitch errors move all regions alike, a wrong roll turns the arrows about the centre, a wrong lens makes them
grow outwards, and a wrong camera position moves near edges more than far ones.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pipeline.alignment.projection import resolve
from pipeline.calibration.depth_edges import EdgeScene
from pipeline.calibration.edge_match import MARGIN, Seen
from pipeline.common.robust import mad_sigma
from pipeline.params import AlignmentParams
from pipeline.types import F64, I64, CameraCalibration

COLUMNS, ROWS = 6, 3
BANDS_M = (0.0, 12.0, 25.0, np.inf)
REACH_WIDTHS, STEPS_ACROSS, STEPS_DOWN = 0.035, 12, 4
"""Range of the tested shifts to each side, in image widths (2.4° at 68°), and number of steps. Only vertical edges are
used, so vertical steps are coarser."""
STANDS_OUT = 4.5
"""Robust standard deviations by which the best shift must exceed the median. On KITTI and Astyx 22 of 57 regions with
enough depth edges reach this, with images of other frames 5 of 285."""
CLEARLY = 1.5
"""Standard deviations by which the best shift must exceed no shift to be shown as an arrow."""
FEWEST = 25
"""Minimum number of depth edges in a region."""
MOST = 6000
"""Maximum number of evaluated depth edges: if there are more, every second, third …"""


@dataclass(frozen=True)
class Region:
    """How depth edges and image edges match in a region of the image, or at a range of distances."""

    borders: int
    """Depth borders in it, of all frames."""
    score: float | None
    """0–1, 1 if no shift is better, 0 if the median shift is as good; None if undetermined."""
    shift_px: tuple[float, float] | None
    """How far the points should move right and down, pixels; (0, 0) if nothing is clearly better. None if
    undetermined."""


@dataclass(frozen=True)
class LocalMatch:
    """All regions."""

    columns: int
    """Of the grid of regions."""
    rows: int
    """Of the grid of regions."""
    grid: tuple[Region, ...]
    """Row by row, from the upper left."""
    bands: tuple[Region, ...]
    """By horizontal distance; their bounds are ``BANDS_M``."""


_NOTHING = Region(0, None, None)
NO_MATCH = LocalMatch(COLUMNS, ROWS, (_NOTHING,) * (COLUMNS * ROWS), (_NOTHING,) * (len(BANDS_M) - 1))


def local_match(scenes: Iterable[Seen], params: AlignmentParams) -> LocalMatch:
    """The match over the frames with the same camera as the last frame. Skips frames without an alignment. Takes 50 ms
    for 20 frames."""
    seen = list(scenes)
    if not seen:
        return NO_MATCH
    shape = seen[-1][0].strength.shape
    members = [(scene, camera) for scene, camera in seen if scene.strength.shape == shape]
    u, v, image, range_m = _projected(members, params)
    keep = slice(None, None, -(-len(u) // MOST) or 1)
    u, v, image, range_m = u[keep], v[keep], image[keep], range_m[keep]
    height, width = shape
    inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
    column = np.clip((u * COLUMNS / width).astype(np.int64), 0, COLUMNS - 1)
    row = np.clip((v * ROWS / height).astype(np.int64), 0, ROWS - 1)
    band = np.digitize(range_m, BANDS_M[1:-1])
    cells = COLUMNS * ROWS
    cell = np.where(inside, row * COLUMNS + column, cells)
    band = np.where(inside, band, len(BANDS_M) - 1)
    shifts, strengths = _shifted([scene for scene, _ in members], u, v, image, (cell, band))
    grid = _regions(shifts, strengths[0][:, :-1], np.bincount(cell, minlength=cells + 1)[:-1])
    bands = _regions(shifts, strengths[1][:, :-1], np.bincount(band, minlength=len(BANDS_M))[:-1])
    return LocalMatch(COLUMNS, ROWS, grid, bands)


def _projected(
    members: list[tuple[EdgeScene, CameraCalibration | None]], params: AlignmentParams
) -> tuple[F64, F64, I64, F64]:
    """(E,) column and row in the image, image index, and horizontal distance, of the depth edges in or near the
    images."""
    parts = [(np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros(0))]
    for number, (scene, camera) in enumerate(members):
        aligned = resolve(params, camera)
        if aligned is None or not len(scene.points):
            continue
        uv = aligned.project(scene.points)
        height, width = scene.strength.shape
        near = (np.abs(uv / [width, height] - 0.5) < 0.5 + MARGIN).all(axis=1)  # false for NaN, behind the camera
        range_m = np.hypot(scene.points[near, 0], scene.points[near, 1])
        parts.append((uv[near], np.full(int(near.sum()), number), range_m))
    uv, image, range_m = (np.concatenate(each) for each in zip(*parts, strict=True))
    return uv[:, 0], uv[:, 1], image, range_m


def _shifted(
    scenes: list[EdgeScene], u: F64, v: F64, image: I64, groups: tuple[I64, I64]
) -> tuple[F64, tuple[F64, F64]]:
    """(S, 2) shifts in pixels, and for each of the two groupings (S, G) the mean excess strength of image edges at a
    group's depth edges."""
    height, width = scenes[0].strength.shape
    strength = np.concatenate([scene.strength for scene in scenes])
    usual = np.concatenate([scene.usual for scene in scenes])
    reach = REACH_WIDTHS * width
    across = np.arange(-STEPS_ACROSS, STEPS_ACROSS + 1) * (reach / STEPS_ACROSS)
    down = np.arange(-STEPS_DOWN, STEPS_DOWN + 1) * (reach / STEPS_DOWN)
    shifts = np.array([(du, dv) for dv in down for du in across])
    counts = [np.maximum(np.bincount(group), 1) for group in groups]
    found: tuple[list[F64], list[F64]] = ([], [])
    for du, dv in shifts:
        column, row = (u + du).astype(np.int64), (v + dv).astype(np.int64)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        at = np.where(inside, row, 0) + image * height
        met = np.where(inside, strength[at, np.where(inside, column, 0)] - usual[at], 0.0)
        for sums, group, count in zip(found, groups, counts, strict=True):
            sums.append(np.bincount(group, weights=met, minlength=len(count)) / count)
    width_of = (COLUMNS * ROWS + 1, len(BANDS_M))
    padded = [
        np.pad(np.array(sums), ((0, 0), (0, wanted - np.array(sums).shape[1])))
        for sums, wanted in zip(found, width_of, strict=True)
    ]
    return shifts, (padded[0], padded[1])


def _regions(shifts: F64, strengths: F64, borders: I64) -> tuple[Region, ...]:
    """One region per group, from (S, G) strengths."""
    present = int(np.flatnonzero((shifts == 0.0).all(axis=1))[0])
    return tuple(
        _region(shifts, strengths[:, group], present, int(count)) for group, count in enumerate(borders.tolist())
    )


def _region(shifts: F64, strength: F64, present: int, borders: int) -> Region:
    if borders < FEWEST:
        return Region(borders, None, None)
    usual, best = float(np.median(strength)), int(np.argmax(strength))
    noise = max(mad_sigma(strength - usual), 1e-6)
    height = float(strength[best]) - usual
    is_at_the_end = abs(shifts[best, 1]) == np.abs(shifts[:, 1]).max()
    if height / noise < STANDS_OUT or is_at_the_end:
        return Region(borders, None, None)
    score = float(np.clip((strength[present] - usual) / height, 0.0, 1.0))
    is_clear = (1.0 - score) * height / noise >= CLEARLY
    du, dv = shifts[best].tolist() if is_clear else (0.0, 0.0)
    return Region(borders, round(score, 4), (round(du, 1), round(dv, 1)))
