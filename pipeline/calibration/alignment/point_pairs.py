"""Fits the alignment to pairs picked by hand: a place that the LiDAR measured, and the pixel where a person sees it.

1. **Start.** With four pairs or more, small random subsets of the pairs are solved; the solution with the smallest
   median residual counts (least median of squares), so that a wrong pair among them does no harm.
2. **Inliers.** Pairs far from that solution, relative to the scatter of the others, are wrong and left out.
3. **Least squares** on the rest, each pair weighted by how precisely it can be picked.

The uncertainty follows from the residuals' scatter and where the pairs lie. What the pairs do not determine, because
they lie in one direction or at one distance, is refused with the pair that is missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import comb

import numpy as np

from pipeline.alignment.projection import pixels_per_radian
from pipeline.calibration.alignment.models import PLACE, VIEWS_DEG, FitModel, ModelName, rounded
from pipeline.calibration.alignment.point_pair_doubts import (
    PairsRefused,
    refuse_at_bounds,
    refuse_undetermined,
    warnings_of_pairs,
)
from pipeline.params import AlignmentParams
from pipeline.types import F64, I64, CameraCalibration

PICK_DEG = 0.2
"""Standard deviation of a picked pixel, per axis: the distance between a LiDAR's points, and a steady hand."""
CLUSTER_M = 0.25
"""Standard deviation of where the vehicle of a cluster stands on the road, in the middle of its width: beams miss its
sides, and the road below it is hidden. With detected boxes in place of the hand, errors on KITTI 0009 and Astyx are
within two deviations of the fit in 77 to 100 % of the cases."""
FEWEST = 2
"""Minimum number of pairs, each of two equations, for three angles or for the four values of the angular model; the
position needs one more."""
SPARE = 2
"""Pairs beyond the fewest with which a wrong one can be told from the others."""
OUTLIER = 4.0
"""A pair farther away than this many standard deviations is wrong."""
MOST_SUBSETS = 24
PRIOR = 4.0
"""Weight of the expected scatter against the measured one, in degrees of freedom."""
_MEDIAN = 1.39
"""Of the sum of two squared standard normal residuals."""
_STEP = 1e-5
"""For derivatives."""
_NOTHING = 1e-6
"""Smallest singular value; below it, nothing is determined."""
_ROUGHLY = 3
"""Steps towards a subset's solution."""
_FAR_OFF = 1e3
"""Residual of a point that the camera cannot see, in standard deviations; finite, so that a search leaves it."""


@dataclass(frozen=True, eq=False)
class PointPair:
    """A place in the ego frame and its pixel."""

    point: F64
    """(3,) metres, ego frame."""
    pixel: F64
    """(2,) column and row in the image as it was taken."""
    sigma_m: float = 0.0
    """Standard deviation of the place across the line of sight, besides that of the pixel."""


@dataclass(frozen=True, eq=False)
class PointPairFit:
    """The alignment that brings points to their pixels."""

    model: ModelName
    """Which of the two projections was fitted."""
    values: Mapping[str, float]
    """Of ``AlignmentParams``, by name."""
    sigmas: Mapping[str, float]
    """Standard deviation of each value."""
    projected: F64
    """(N, 2) pixels where the fit projects the points; NaN for a point that the camera cannot see."""
    rms_px: float
    """Root mean square distance of projected points from their pixels, without outliers."""
    outliers: tuple[int, ...] = ()
    """Indices of the pairs that contradict the others and were left out."""
    warnings: tuple[str, ...] = ()
    """What to check, as sentences."""
    place_m: Mapping[str, float] = field(default_factory=dict)
    """The camera's shift as it was, as far as it was not fitted and is not zero."""

    @property
    def changes(self) -> dict[str, float | str]:
        """As a change of parameters by dotted name."""
        section: dict[str, float | str] = {"model": self.model, **self.place_m, **self.values}
        return {f"alignment.{name}": value for name, value in section.items()}


def fit_point_pairs(
    pairs: Sequence[PointPair],
    name: ModelName,
    present: AlignmentParams,
    camera: CameraCalibration | None,
    size: tuple[int, int],
    offset: bool = False,
) -> PointPairFit:
    """The model's parameters from pairs of one camera. Deterministic.

    present: a pinhole model keeps its position. size: width and height of the image. offset: of a pinhole model, also
    fit the position, laterally and in height. PairsRefused if the pairs do not determine the parameters.
    """
    if name == "pinhole" and camera is None:
        raise PairsRefused("the pinhole model needs the camera's calibration; choose the angular model")
    place_m = {each: value for each in PLACE if name == "pinhole" and (value := getattr(present, each))}
    model = FitModel(name, camera, size, offset and name == "pinhole", place_m=place_m)
    fewest = FEWEST + (1 if model.offset else 0)
    if len(pairs) < fewest:
        more = f"{fewest} pairs are needed{', with the position' if model.offset else ''}"
        raise PairsRefused(f"{more}; {fewest - len(pairs)} more")
    problem = _Problem(pairs, model)
    vector, rows = problem.start(), np.arange(len(pairs))
    if len(pairs) >= fewest + SPARE:
        vector, rows = problem.robust(vector, fewest)
    vector = problem.solved(vector, rows)
    covariance = problem.covariance(vector, rows)
    refuse_undetermined(model, np.sqrt(np.diag(covariance)))
    refuse_at_bounds(model, vector)
    whitened = problem.residuals(vector)[rows]
    free = whitened.size - len(vector)
    scatter = float(np.sqrt((PRIOR + np.sum(whitened**2)) / (PRIOR + free)))
    projected = model.aligned(vector).project(problem.points)
    off_px = np.linalg.norm(projected - problem.pixels, axis=1)
    outliers = tuple(int(k) for k in np.setdiff1d(np.arange(len(pairs)), rows))
    return PointPairFit(
        model=name,
        values=rounded(model.values(vector)),
        sigmas=_sigmas(model, vector, scatter**2 * covariance),
        projected=projected,
        rms_px=float(np.sqrt(np.mean(off_px[rows] ** 2))),
        outliers=outliers,
        warnings=tuple(warnings_of_pairs(off_px, outliers, scatter, is_checked=len(rows) > fewest)),
        place_m=place_m,
    )


class _Problem:
    """Residuals of the pairs in standard deviations."""

    def __init__(self, pairs: Sequence[PointPair], model: FitModel) -> None:
        self._model = model
        self.points = np.array([each.point for each in pairs], np.float64).reshape(-1, 3)
        self.pixels = np.array([each.pixel for each in pairs], np.float64).reshape(-1, 2)
        blur_rad = np.array([each.sigma_m for each in pairs]) / np.maximum(np.linalg.norm(self.points, axis=1), 0.1)
        self._sigma_rad = np.hypot(np.radians(PICK_DEG), blur_rad)

    def start(self) -> F64:
        """The recording's own calibration; for an angular model, the straight lines through angles and pixels."""
        model = self._model
        if model.name == "pinhole":
            return np.zeros(len(model.unknowns))
        x, y, z = self.points.T
        angles_deg = np.degrees([np.arctan2(-y, x), -np.arctan2(z, np.hypot(x, y))])
        middle = self.pixels - np.array(model.size) / 2
        usual_deg = np.median(VIEWS_DEG) / model.size[0]
        h_deg, v_deg = (_slope(px, deg, usual_deg) for px, deg in zip(middle.T, angles_deg, strict=True))
        across, down = middle.mean(axis=0) - angles_deg.mean(axis=1) / (h_deg, v_deg)
        return np.array([np.log(h_deg), np.log(v_deg), across * h_deg, down * h_deg])

    def residuals(self, vector: F64) -> F64:
        """(N, 2) in standard deviations."""
        aligned = self._model.aligned(vector)
        off = aligned.project(self.points) - self.pixels
        per_radian = pixels_per_radian(aligned) or float(max(self._model.size))
        return np.where(np.isnan(off), _FAR_OFF, off / (per_radian * self._sigma_rad)[:, None])

    def solved(self, start: F64, rows: I64, steps: int = 20) -> F64:
        """Least squares on some pairs by Gauss and Newton, within the model's bounds: pixels are nearly linear in
        the unknowns."""
        low, high = self._model.bounds()
        vector = np.clip(start, low, high)
        for _ in range(steps):
            jacobian = self._jacobian(vector)[rows].reshape(-1, len(vector))
            step = np.linalg.lstsq(jacobian, -self.residuals(vector)[rows].ravel(), rcond=_NOTHING)[0]
            moved = np.clip(vector + step, low, high)
            is_there = bool(np.abs(moved - vector).max() < _STEP / 100)
            vector = moved
            if is_there:
                break
        return vector

    def robust(self, start: F64, fewest: int) -> tuple[F64, I64]:
        """The solution of a subset that most pairs agree with, and the rows of these pairs."""
        count = len(self.points)
        rank = (count + fewest + 1) // 2  # a subset explains its own pairs, so that the median alone would say little
        best, least = start, np.inf
        for rows in _subsets(count, fewest):
            found = self.solved(start, rows, _ROUGHLY)
            square = float(np.sort(np.sum(self.residuals(found) ** 2, axis=1))[rank - 1])
            if square < least:
                best, least = found, square
        scale = (1.0 + 5.0 / (2 * count - len(start))) * np.sqrt(least / _MEDIAN)  # Rousseeuw's, for few measurements
        reach = OUTLIER * max(1.0, float(scale))
        rows = np.flatnonzero(np.linalg.norm(self.residuals(best), axis=1) <= reach)
        best = self.solved(best, rows)
        return best, np.flatnonzero(self._predicted(best, rows) <= reach)

    def covariance(self, vector: F64, rows: I64) -> F64:
        """(P, P) for the expected scatter; huge where the pairs determine nothing."""
        _, sizes, axes = np.linalg.svd(self._jacobian(vector)[rows].reshape(-1, len(vector)))
        sizes = np.concatenate([sizes, np.zeros(len(vector) - len(sizes))])
        return np.asarray((axes.T / np.maximum(sizes, _NOTHING) ** 2) @ axes)

    def _predicted(self, vector: F64, rows: I64) -> F64:
        """(N,) distances from where a solution of some pairs predicts each, in standard deviations of this
        prediction."""
        jacobian = self._jacobian(vector)
        spread = np.eye(2) + jacobian @ self.covariance(vector, rows) @ jacobian.transpose(0, 2, 1)
        off = self.residuals(vector)[:, :, None]
        return np.sqrt((off.transpose(0, 2, 1) @ np.linalg.solve(spread, off))[:, 0, 0])

    def _jacobian(self, vector: F64) -> F64:
        """(N, 2, P) of the residuals."""
        slopes = [
            (self.residuals(vector + _STEP * unit) - self.residuals(vector - _STEP * unit)) / (2 * _STEP)
            for unit in np.eye(len(vector))
        ]
        return np.stack(slopes, axis=-1)


def _subsets(count: int, fewest: int) -> list[I64]:
    """All small subsets, or a fixed random selection of them."""
    if comb(count, fewest) <= MOST_SUBSETS:
        return [np.array(each) for each in combinations(range(count), fewest)]
    rng = np.random.default_rng(0)
    return [rng.permutation(count)[:fewest] for _ in range(MOST_SUBSETS)]


def _slope(pixels: F64, angles_deg: F64, usual_deg: float) -> float:
    """Degrees per pixel of the line through angles and pixels; the usual one where that makes no sense."""
    spread = pixels - pixels.mean()
    square = float(spread @ spread)
    slope = float(spread @ (angles_deg - angles_deg.mean())) / square if square > 0.0 else 0.0
    return slope if usual_deg / 4.0 < slope < usual_deg * 4.0 else usual_deg


def _sigmas(model: FitModel, vector: F64, covariance: F64) -> dict[str, float]:
    """Of the parameter values, from the covariance of the vector."""

    def values(at: F64) -> F64:
        return np.array(list(model.values(at).values()))

    slopes = [
        (values(vector + _STEP * unit) - values(vector - _STEP * unit)) / (2 * _STEP) for unit in np.eye(len(vector))
    ]
    jacobian = np.array(slopes).T
    found = np.sqrt(np.diag(jacobian @ covariance @ jacobian.T)).tolist()
    return dict(zip(model.unknowns, found, strict=True))
