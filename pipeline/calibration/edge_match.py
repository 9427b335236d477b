"""Measures how well LiDAR and images match: whether depth edges coincide with image edges more than with a turned
mount.

The image gradient under the depth edges says little by itself, because it varies more between roads than between a
right and a wrong mount. As in Levinson and Thrun (2013), the same is therefore measured with the mount turned to all
sides, and the score is the position of the current mount between the usual and the best of these. If none of them
stands out, there is no score.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.alignment.projection import Alignment, Angular, resolve
from pipeline.calibration.depth_edges import EdgeScene
from pipeline.common.robust import mad_sigma
from pipeline.params import AlignmentParams
from pipeline.types import F32, F64, I64, U8, CameraCalibration

Seen = tuple[EdgeScene, CameraCalibration | None]

REACH_DEG, YAW_STEP_DEG, PITCH_STEP_DEG = 3.0, 0.25, 0.5
"""Search range and steps of the mount's rotation. The score responds to an edge within 0.3° in yaw, and within 1° in
pitch."""
ROLLS_DEG = (-4.0, -2.0, -1.0, 1.0, 2.0, 4.0)
ZOOMS = (0.9, 0.95, 1.05, 1.1)
MARGIN = 0.2
"""Depth edges this far outside the image, in image sizes, are included, because a rotation may bring them in."""
STANDS_OUT = 4.8
"""Robust standard deviations by which the best alignment must exceed the median. With 20 frames of Astyx (16 rings) or
12 of KITTI, correct mounts within range have 4.86 and more; mounts 6° and more off and images of other frames 4.6 at
most."""
CLEARLY = 1.5
"""Standard deviations by which the best alignment must exceed the current one to be reported; smaller differences are
within the accuracy of edges. On Astyx and KITTI this is less than 0.5° in yaw and 1° in pitch."""
FEWEST = 100
"""Minimum number of depth edges in the images."""
MOST = 8000
"""Maximum number of evaluated depth edges of one camera: if there are more, every second, third …"""


@dataclass(frozen=True)
class EdgeScore:
    """How well one alignment matches depth edges to image edges."""

    score: float | None
    """0–1: 1 if no nearby alignment is better, 0 if the median of them is as good. None if too few depth edges are
    visible, or if no nearby alignment stands out."""
    sigmas: float | None
    """How far the best alignment stands out from its neighbours. None if too few depth edges are visible."""
    borders: int
    """Depth edges in the images."""
    better: Mapping[str, float] = field(default_factory=dict)
    """Changes of parameters (``AlignmentParams``; a factor for h_res_deg and v_res_deg) that lead to the best nearby
    alignment; empty unless it is clearly better."""


@dataclass(frozen=True)
class Near:
    """An alignment near the current one."""

    change: Mapping[str, float]
    """The changed parameters, by name, in the format of ``EdgeScore.better``."""
    aligned: Alignment
    """Projects ego points with these changes applied."""


def edge_score(scenes: Iterable[Seen], params: AlignmentParams) -> EdgeScore:
    """The score over several frames, since a single sweep of 16 rings has few depth edges. Skips frames without an
    alignment. Takes a tenth of a second for 20 frames."""
    met: F64 = np.zeros(1)
    usually: F64 = np.zeros(1)
    borders = 0
    near: tuple[Near, ...] = ()
    for camera, members in _by_camera(scenes):
        around = surroundings(params, camera)
        if not around:
            continue
        images = _Images.of(members, around[0].aligned)
        sums = np.array([images.under(each.aligned) for each in around])
        met, usually, near = met + sums[:, 0], usually + sums[:, 1], around
        borders += int(sums[0, 2])
    if borders < FEWEST:
        return EdgeScore(None, None, borders)
    return _placed(met / np.maximum(usually, 1e-6), borders, near)


def surroundings(params: AlignmentParams, camera: CameraCalibration | None) -> tuple[Near, ...]:
    """The current alignment first, then rotated in all directions, rolled, or zoomed; empty without an alignment."""
    present = resolve(params, camera)
    if present is None:
        return ()
    grid = [(yaw, pitch) for pitch in _steps(PITCH_STEP_DEG) for yaw in _steps(YAW_STEP_DEG) if yaw or pitch]
    if isinstance(present, Angular):
        return (Near({}, present), *(_slid(present, *turn) for turn in grid), *(_zoomed(present, by) for by in ZOOMS))
    turns = [{"yaw_deg": yaw, "pitch_deg": pitch} for yaw, pitch in grid] + [{"roll_deg": roll} for roll in ROLLS_DEG]
    return (Near({}, present), *(_turned(params, camera, turn) for turn in turns))


def _placed(strengths: F64, borders: int, near: Sequence[Near]) -> EdgeScore:
    """Rank of the first of the strengths among all."""
    usual, best = float(np.median(strengths)), int(np.argmax(strengths))
    height = float(strengths[best]) - usual
    sigmas = round(height / max(mad_sigma(strengths - usual), 1e-6), 2)
    if sigmas < STANDS_OUT:
        return EdgeScore(None, sigmas, borders)
    score = float(np.clip((strengths[0] - usual) / height, 0.0, 1.0))
    is_clear = (1.0 - score) * sigmas >= CLEARLY
    return EdgeScore(round(score, 4), sigmas, borders, near[best].change if is_clear else {})


def _steps(step_deg: float) -> list[float]:
    return np.arange(-REACH_DEG, REACH_DEG + step_deg / 2, step_deg).tolist()


def _turned(params: AlignmentParams, camera: CameraCalibration | None, turn: Mapping[str, float]) -> Near:
    moved = {name: getattr(params, name) + by for name, by in turn.items()}
    aligned = resolve(params.model_copy(update=moved), camera)
    assert aligned is not None
    return Near({name: by for name, by in turn.items() if by}, aligned)


def _slid(present: Angular, yaw_deg: float, pitch_deg: float) -> Near:
    """For the model without a mount: the cloud is shifted over the image instead."""
    u, v = round(np.radians(yaw_deg) / present.h_res_rad), round(np.radians(pitch_deg) / present.v_res_rad)
    change = {name: float(by) for name, by in (("cx_px", u), ("cy_px", v)) if by}
    return Near(change, replace(present, cx=present.cx + u, cy=present.cy + v))


def _zoomed(present: Angular, by: float) -> Near:
    zoomed = replace(present, h_res_rad=present.h_res_rad * by, v_res_rad=present.v_res_rad * by)
    return Near({"h_res_deg": by, "v_res_deg": by}, zoomed)


def _by_camera(scenes: Iterable[Seen]) -> list[tuple[CameraCalibration | None, list[EdgeScene]]]:
    """Groups frames with equal calibration and image size: their depth edges are projected at once."""
    groups: dict[object, tuple[CameraCalibration | None, list[EdgeScene]]] = {}
    for scene, camera in scenes:
        numbers = camera and tuple(a.tobytes() for a in (camera.K, camera.distortion, camera.T_camera_ego))
        groups.setdefault((numbers, scene.strength.shape), (camera, []))[1].append(scene)
    return list(groups.values())


@dataclass(frozen=True, eq=False)
class _Images:
    """Images of one camera stacked vertically, and the depth edges that may fall into them. first_row: (E,) first row
    of each depth edge's image."""

    points: F64
    first_row: I64
    strength: U8
    usual: F32
    height: int

    @classmethod
    def of(cls, scenes: Sequence[EdgeScene], present: Alignment) -> _Images:
        height, width = scenes[0].strength.shape
        points = np.concatenate([scene.points for scene in scenes])
        first_row = np.repeat(np.arange(len(scenes)) * height, [len(scene.points) for scene in scenes])
        # false for NaN, behind the camera
        within = np.abs(present.project(points) / [width, height] - 0.5) < 0.5 + MARGIN
        near = np.flatnonzero(within.all(axis=1))
        near = near[:: -(-len(near) // MOST) or 1]
        strength, usual = (np.concatenate([getattr(scene, name) for scene in scenes]) for name in ("strength", "usual"))
        return cls(points[near], first_row[near], strength, usual, height)

    def under(self, aligned: Alignment) -> tuple[float, float, int]:
        """Sums of the edge strengths at the depth edges and of the mean strengths of their rows; number of visible
        depth edges."""
        u, v = aligned.project(self.points).T
        seen = (u >= 0) & (u < self.strength.shape[1]) & (v >= 0) & (v < self.height)
        row = self.first_row[seen] + v[seen].astype(np.int64)
        met = self.strength[row, u[seen].astype(np.int64)]
        return float(met.sum(dtype=np.int64)), float(self.usual[row].sum(dtype=np.float64)), len(row)
