"""Roll from depth edges: where the LiDAR sees an object end, the image has an edge.

Boxes hardly determine the roll of a camera when all vehicles are ahead, and a wrong roll also makes the pitch wrong.
Depth edges are everywhere in the image, beside the road as well. For each roll, yaw and pitch follow from the boxes;
the roll whose projected depth edges lie on the strongest edges of the images is the right one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numba
import numpy as np

from pipeline.calibration.alignment.models import REACH_DEG, FitModel
from pipeline.calibration.depth_edges import EdgeScene
from pipeline.types import F64, I64

MEMORY = 100_000_000
"""Bytes that the edge images of a drive may take: 120 frames of 1242 × 375 pixels take 56 MB, 48 of full HD 100 MB."""
MOST = 30_000
"""Maximum number of evaluated depth edges: if there are more, every second, third …"""
COARSE_DEG = np.arange(-REACH_DEG + 1.0, REACH_DEG, 1.0)
FINE_DEG = np.arange(-1.5, 1.51, 0.25)
"""Rolls of the search, and those around the best of them."""
ROLL_STEPS = len(COARSE_DEG) + len(FINE_DEG)
"""Number of progress steps of the search."""
YAWS_DEG = tuple(np.arange(-0.6, 0.61, 0.2).round(2).tolist())
"""Yaws relative to that of the boxes: a box and the edge of a vehicle may differ by a few pixels everywhere."""
BLOCK_NS = 500_000_000
"""Frames within half a second show the same edges and are resampled together."""
FEWEST, FEWEST_BLOCKS = 500, 4
"""Fewest depth edges and pieces of the drive for a verdict."""
DRAWS = 60
"""Resampled drives, for the standard deviation."""
WIDEST_DEG = 0.7
"""Above this standard deviation, no roll stands out."""
_NEAREST_SIGMA_DEG = 0.1
"""Resampling one drive never shows the errors that all of its frames share: no roll is known better than this."""


class EdgeView(NamedTuple):
    """Depth edges and edge image of a frame."""

    scene: EdgeScene
    """What does not depend on the alignment."""
    t_ns: int
    """The tick."""


class EdgeStack:
    """The depth edges of several frames of one camera, ready to be scored."""

    def __init__(self, views: Sequence[EdgeView]) -> None:
        every = -(-sum(len(each.scene.points) for each in views) // MOST) or 1
        kept = [each.scene.points[::every] for each in views]
        self._scenes = [each.scene for each in views]
        self._points = np.concatenate(kept)
        self._cuts = np.cumsum([0, *map(len, kept)])
        self.blocks, self._block = np.unique([each.t_ns // BLOCK_NS for each in views], return_inverse=True)
        """(B,) numbers of the pieces of the drive."""

    def strengths(self, model: FitModel, vector: F64) -> F64:
        """(B,) sums of edge strength at the depth edges of each piece, for one alignment."""
        uv, found = model.aligned(vector).project(self._points), np.zeros(len(self.blocks))
        for scene, block, (first, last) in zip(self._scenes, self._block, pairwise(self._cuts), strict=True):
            found[block] += _met(uv[first:last], scene.strength, scene.usual)
        return found


@numba.njit(cache=True, nogil=True)
def _met(uv, strength, usual):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Sum of what the edge image (H, W) has more than the mean of its row (H,), at (E, 2) pixels. NaN is outside."""
    height, width = strength.shape
    total = 0.0
    for n in range(len(uv)):
        u, v = uv[n]
        if 0.0 <= u < width and 0.0 <= v < height:
            row = int(v)
            total += strength[row, int(u)] - usual[row]
    return total


def stack_of(views: Sequence[EdgeView]) -> EdgeStack | None:
    """None if there are too few edges to say anything."""
    if sum(len(each.scene.points) for each in views) < FEWEST:
        return None
    stack = EdgeStack(views)
    return stack if len(stack.blocks) >= FEWEST_BLOCKS else None


class RollScores(NamedTuple):
    """How well edges match, by roll, for each piece of the drive."""

    rolls_deg: F64
    """(R,) ascending, evenly spaced."""
    blocks: I64
    """(B,) numbers of the pieces."""
    strengths: F64
    """(B, R) sums of edge strength at depth edges."""

    def best_deg(self, drawn: I64 | None = None) -> float:
        """The roll with the strongest edges, to a fraction of a step. drawn: rows of the pieces; without it all."""
        total = self.strengths.sum(axis=0) if drawn is None else self.strengths[drawn].sum(axis=0)
        k = int(np.argmax(total))
        if not 0 < k < len(total) - 1:
            return float(self.rolls_deg[k])
        left, middle, right = total[k - 1 : k + 2].tolist()
        off = 0.5 * (left - right) / min(left - 2.0 * middle + right, -1e-9)
        return float(self.rolls_deg[k] + off * (self.rolls_deg[1] - self.rolls_deg[0]))

    def sigma_deg(self) -> float:
        """Standard deviation of the best roll, over resampled drives."""
        rng, count = np.random.default_rng(0), len(self.blocks)
        found = [self.best_deg(rng.integers(0, count, count)) for _ in range(DRAWS)]
        return max(float(np.std(found)), _NEAREST_SIGMA_DEG)


def frames_kept(count: int, size: tuple[int, int]) -> I64:
    """Which of ``count`` frames to take the edges of, so that the edge images fit into ``MEMORY``. size: width and
    height of the images."""
    return np.unique(np.linspace(0, count - 1, min(count, max(MEMORY // (size[0] * size[1]), 1))).round().astype(int))


def roll_scores(
    views: Sequence[EdgeView],
    model: FitModel,
    with_roll: Callable[[float], F64],
    progress: Callable[[int], object] = lambda _: None,
) -> RollScores | None:
    """Scores around the best roll; None if no roll stands out. with_roll: gives the vector that the boxes ask for at a
    roll in degrees. progress: is given the steps done, 0 to ``ROLL_STEPS`` − 1."""
    stack = stack_of(views)
    if stack is None:
        return None
    coarse = _scores(stack, model, with_roll, COARSE_DEG, progress)
    around = coarse.best_deg() + FINE_DEG
    found = _scores(stack, model, with_roll, around, lambda done: progress(len(COARSE_DEG) + done))
    is_inside = around[0] < found.best_deg() < around[-1]
    return found if is_inside and found.sigma_deg() < WIDEST_DEG else None


def _scores(
    stack: EdgeStack,
    model: FitModel,
    with_roll: Callable[[float], F64],
    rolls_deg: F64,
    progress: Callable[[int], object],
) -> RollScores:
    """With the best of the yaws for each roll, over all pieces."""
    strengths = np.zeros((len(stack.blocks), len(rolls_deg)))
    for k, roll in enumerate(rolls_deg.tolist()):
        progress(k)
        vector = with_roll(roll)
        by_yaw = [stack.strengths(model, vector + _turned(yaw, len(vector))) for yaw in YAWS_DEG]
        strengths[:, k] = max(by_yaw, key=lambda each: float(each.sum()))
    return RollScores(rolls_deg, stack.blocks, strengths)


def _turned(yaw_deg: float, unknowns: int) -> F64:
    turned = np.zeros(unknowns)
    turned[0] = yaw_deg
    return turned
