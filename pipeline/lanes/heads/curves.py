"""A curve for each line, (1, n, 8), beside (1, n, 2) scores of nothing and of a line: LSTR (TuSimple, RGB, ImageNet's
mean and spread).

A line on a flat road that bends as a cubic is, in the image, x(y) = k / (y − f)² + m / (y − f) + n + b·y − c
(Liu et al., *End-to-end Lane Shape Prediction with Transformers*, WACV 2021, Eq. 5). The eight numbers are the upper
and lower end in y, k, f, m, n, b and c; x and y in shares of the image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.lanes.heads.head import IMAGENET, LaneHead, LaneOutputs, Points
from pipeline.types import F32

_SAMPLES = 60
"""Gives a sample every three rows for a line of half an image's height."""
_TUSIMPLE_HORIZON = 0.33
"""Learned by the network: if an image's horizon is lower, its lines are too high by the difference. Measured on 11
photographs with the horizon at 0.57: lines are off by 3.4 % of the width, and by 0.4 % with that much sky cut off."""
_HORIZON = 1e-3
"""Closer to the horizon than this share of the image, the curve diverges."""


@dataclass(frozen=True)
class CurveHead(LaneHead):
    """Whether its lines exist is decided by their own scores."""

    scores: int = 0
    """Index of the output with the scores."""

    def points(self, outputs: Sequence[F32]) -> Points:
        """Points on lines from the network's outputs."""
        logits = np.asarray(outputs[self.scores][0], np.float64)
        there = 1.0 / (1.0 + np.exp(np.clip(logits[:, 0] - logits[:, 1], -50.0, 50.0)))
        found = self.read(np.asarray(outputs[self.output][0], np.float32))
        score = there[found.line].astype(np.float32)
        keep = score > 0.5
        return Points(found.uv[keep], score[keep], found.line[keep])


def from_curves(values: F32) -> Points:
    """(n, 8) curves → points from end to end of each, all with score 1."""
    upper, lower, k, f, m, n, b, c = np.asarray(values, np.float64).T[:, :, None]
    y = upper + (lower - upper) * np.linspace(0.0, 1.0, _SAMPLES)
    from_horizon = y - f
    known = np.abs(from_horizon) > _HORIZON
    safe = np.where(known, from_horizon, 1.0)
    x = k / safe**2 + m / safe + n + b * y - c
    keep = known & (x >= 0.0) & (x <= 1.0) & (y >= 0.0) & (y <= 1.0)
    line = np.broadcast_to(np.arange(len(values))[:, None], keep.shape)[keep].astype(np.int32)
    return Points(np.column_stack([x[keep], y[keep]]), np.ones(len(line), np.float32), line)


def recognise(answer: LaneOutputs) -> LaneHead | None:
    """Curves with eight numbers each and as many pairs of scores; the first output of each kind, since training leaves
    auxiliary ones."""
    curves = next((i for i, shape in enumerate(answer.shapes) if len(shape) == 3 and shape[2] == 8), None)
    if curves is None:
        return None
    pairs = (*answer.shapes[curves][:2], 2)
    scores = next((i for i, shape in enumerate(answer.shapes) if tuple(shape) == pairs), None)
    if scores is None:
        return None
    return CurveHead("LSTR", curves, from_curves, "stretch", None, *IMAGENET, horizon=_TUSIMPLE_HORIZON, scores=scores)
