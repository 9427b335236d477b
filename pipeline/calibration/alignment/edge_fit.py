"""The mount from depth edges, near the mount that boxes ask for.

A detector draws its boxes some per cent too high, low or wide, tyres touch the road behind the bumper that the LiDAR
hits, and beams pass through windows below the roof: errors of every frame alike, which no number of frames averages
out. Depth edges have none of them, because both sensors see the same end of the same object, whatever it is. Their
score has many peaks far from the right mount, so boxes are needed to come near it. From there, the mount whose depth
edges lie on the strongest edges of the images is looked for among random mounts, then by Powell's method from the best
of them (Levinson and Thrun 2013 climb the same kind of score).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import Bounds, minimize

from pipeline.calibration.alignment.edges import WIDEST_DEG, EdgeStack, EdgeView, stack_of
from pipeline.calibration.alignment.models import FitModel
from pipeline.types import F64

SPREAD = {"yaw_deg": 0.25, "pitch_deg": 0.4, "roll_deg": 0.5, "left_m": 0.07, "up_m": 0.12, "zoom": 0.012}
"""Standard deviations of the random mounts around that of the boxes; of the zoom, in shares of it. The largest errors
of the boxes' fit on three recordings are twice as large (``docs/reference/accuracy-alignment.md``)."""
CANDIDATES, STARTS = 150, 3
"""Random mounts, and how many of the best are improved."""
STEPS = STARTS + 1
"""Number of progress steps."""
_REACH = 4.0
"""Farthest from the boxes' mount, in standard deviations; a best mount there is none."""
_UNIT = {"yaw_deg": 0.2, "pitch_deg": 0.2, "roll_deg": 0.4, "left_m": 0.05, "up_m": 0.05, "zoom": 0.008}
"""Differences that lower the score about equally: a few pixels at the usual ranges, or at the image's border."""
ROLL = 2
"""Of the unknowns."""
_EVALUATIONS = 500
_CLOSE, _SAMPLES = 0.75, 150
"""Spread of the mounts that show the shape of the peak, in units, and their number: seven per number to determine."""


class EdgeFit(NamedTuple):
    """The best mount by depth edges."""

    vector: F64
    """(P,) of ``FitModel``."""
    sigmas: F64
    """(P,) standard deviations, from the differences between the pieces of the drive."""


def fit_edges(
    views: Sequence[EdgeView], model: FitModel, start: F64, progress: Callable[[int], object] = lambda _: None
) -> EdgeFit | None:
    """The best mount near ``start``, a vector of a pinhole model; None with too few edges, or if none stands out.
    progress: is given the steps done, 0 to ``STEPS`` − 1."""
    stack = stack_of(views)
    if stack is None:
        return None
    rng, count = np.random.default_rng(0), len(start)
    unit, spread = (np.array([each[name] for name in model.unknowns]) for each in (_UNIT, SPREAD))

    def score(vector: F64) -> float:
        return float(stack.strengths(model, vector).sum())

    progress(0)
    around = np.vstack([start, start + rng.normal(size=(CANDIDATES, count)) * spread])
    scores = np.array([score(vector) for vector in around])
    scale = float(np.abs(scores).max()) or 1.0
    best, best_score = start, -np.inf
    reach = _REACH * spread / unit
    for number, k in enumerate(np.argsort(-scores)[:STARTS].tolist()):
        progress(1 + number)
        centre = around[k] / unit
        low, high = start / unit - reach, start / unit + reach
        found = minimize(  # type: ignore[call-overload]  # the stubs know no options of Powell's
            lambda at: -score(at * unit) / scale,
            np.clip(centre, low, high),
            method="Powell",
            bounds=Bounds(low, high),
            options={"maxfev": _EVALUATIONS, "xtol": 0.03, "ftol": 1e-4},
        )
        if -found.fun > best_score:
            best, best_score = found.x * unit, -float(found.fun)
    if (np.abs(best - start) > 0.98 * _REACH * spread).any():
        return None
    sigmas = _sigmas(stack, model, best, unit, rng)
    return EdgeFit(best, sigmas) if sigmas[ROLL] < WIDEST_DEG else None


def _sigmas(stack: EdgeStack, model: FitModel, best: F64, unit: F64, rng: np.random.Generator) -> F64:
    """The sandwich estimate (Huber 1967): the slopes of the pieces' scores at the common peak, against its curvature.

    The score is not smooth, so slopes and curvature are those of a quadratic function fitted to mounts around the peak.
    """
    count = len(best)
    steps = rng.normal(size=(_SAMPLES, count)) * _CLOSE
    strengths = np.array([stack.strengths(model, best + step * unit) for step in steps])
    rows, columns = np.triu_indices(count)
    terms = np.column_stack([np.ones(len(steps)), steps, steps[:, rows] * steps[:, columns]])
    fitted = np.linalg.lstsq(terms, strengths, rcond=None)[0]
    slopes, second = fitted[1 : count + 1].T, fitted[count + 1 :].sum(axis=1)
    curvature = np.zeros((count, count))
    curvature[rows, columns] = second
    curvature = -(curvature + curvature.T)
    strength, axes = np.linalg.eigh(curvature)
    # A direction in which the score does not fall is unknown within the mounts looked at
    widest = max(SPREAD[name] / _UNIT[name] for name in model.unknowns)
    scatter = ((slopes - slopes.mean(axis=0)) @ axes).std(axis=0) * np.sqrt(len(slopes))
    sigma = np.minimum(scatter / np.maximum(strength, 1e-9), widest)
    return np.asarray(np.sqrt((axes**2) @ sigma**2) * unit)
