"""Fits lines to points on the ground, robustly: first the common heading and curvature of all lines of a road, then
each line separately.

A point is stored as its bearing and its inverse distance from the camera, because that is what an image measures:

    slope = y/x      inverse = 1/x      (x, y metres on flat ground from the foot of the camera)

A pitch error p of a camera at height h moves every point to 1/x + p/h at the same slope, so a hypothesis about the
pitch costs one addition (Stein, Mano, Shashua, IV 2003, use the same geometry for distance).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from pipeline.types.lane import F64

Picked = npt.NDArray[np.bool_] | npt.NDArray[np.int64] | slice

_NEAREST_M, _VOTE_REACH_M, _FARTHEST_M = 2.5, 32.0, 90.0
_BIN_M, _BINS = 0.2, 90
"""Lateral histogram at x = 0: ±9 m."""
_PEAK_GAP_M = 1.2
"""Minimum distance between two lines of one road; a double line counts as one."""
_MAX_LINES = 6
_VOTED_POINTS = 220
_WIDE_GATE_M, _GATE_PER_M = 0.35, 0.012
_PAINT_SIGMA_M = 0.05
_LAST_GATE = 0.5
"""The gate shrinks to this share over the rounds, as the line converges to its points."""
_AROUND = 2.5
_BY_CHANCE = 1.0 / _AROUND
"""Points within this many gates are considered; of evenly distributed clutter, this share lies within the gate."""
_SHARED_ERROR = 4.0
"""Errors of points in neighbouring rows are correlated: this many count as one."""
_COVER_FROM_M, _COVER_STEP_M, _COVER_BINS = 4.0, 2.0, 12
_ENOUGH_POINTS = 14
_ENOUGH_COVER = 5.0
"""Number of 2 m segments with paint for a certain line; a broken line of 3 m in 12 m has about as many up to 28 m."""


@dataclass(frozen=True, eq=False)
class RoadCurve:
    """Shape shared by all lines of a road, and the search range of each value."""

    heading_rad: float = 0.0
    """Heading of the road relative to the car, positive to the left."""
    curvature_per_m: float = 0.0
    """1/radius, positive to the left."""
    pitch_rad: float = 0.0
    """Pitch of the camera relative to its calibration, positive downwards."""
    heading_reach_rad: float = 0.12
    """Search range to either side."""
    curvature_reach_per_m: float = 1.0 / 120.0
    """Search range to either side: initially down to a radius of 120 m."""
    pitch_reach_rad: float = 0.03
    """Search range to either side."""


@dataclass(frozen=True, eq=False)
class FittedLine:
    """y(x) of one line, relative to the foot of the camera."""

    coefficients: F64
    """(4,) of y = c0 + c1 x + c2 x² + c3 x³, metres."""
    covariance: F64
    """(4, 4) of the coefficients."""
    x_min_m: float
    """Nearest point used by the fit."""
    x_max_m: float
    """Farthest point used by the fit."""
    quality: float
    """0–1."""


@dataclass(frozen=True, eq=False)
class Sightings:
    """Points of an image, projected to the road."""

    slope: F64
    """(M,) float64 y/x; see this module's docstring."""
    inverse: F64
    """(M,) float64 1/x, per metre."""
    weight: F64
    """(M,) float64, 0–1."""
    height_m: float
    """Height of the camera above the road."""

    def only(self, picked: Picked) -> Sightings:
        return Sightings(self.slope[picked], self.inverse[picked], self.weight[picked], self.height_m)

    def x_m(self, pitch_rad: float) -> F64:
        """(M,) metres ahead for a given pitch."""
        return 1.0 / (self.inverse + pitch_rad / self.height_m)


def shared_shape(seen: Sightings, around: RoadCurve) -> tuple[RoadCurve, F64]:
    """The shape for which the points concentrate most sharply into lines, and their lateral histogram (90,) for it."""
    if len(seen.slope) > _VOTED_POINTS:
        seen = seen.only(np.linspace(0, len(seen.slope) - 1, _VOTED_POINTS).astype(np.int64))
    headings = _grid(around.heading_rad, around.heading_reach_rad, 0.015)
    bends = _grid(around.curvature_per_m, around.curvature_reach_per_m, 0.0014)
    pitches = _grid(around.pitch_rad, around.pitch_reach_rad, 0.006)
    best, histogram = _vote(seen.slope, seen.inverse, seen.weight, seen.height_m, headings, bends, pitches)
    return RoadCurve(*best.tolist()), histogram


def peaks(histogram: F64) -> list[float]:
    """Lateral positions (metres at x = 0, from the foot of the camera) of the peaks in the histogram, strongest
    first."""
    smooth = np.convolve(histogram, (0.5, 1.0, 0.5), mode="same")
    found: list[float] = []
    for place in np.argsort(-smooth, kind="stable").tolist():
        if smooth[place] <= 0.0 or len(found) == _MAX_LINES:
            break
        y = (place + 0.5 - _BINS / 2) * _BIN_M
        if all(abs(y - other) >= _PEAK_GAP_M for other in found):
            found.append(y)
    return found


def fit_line(
    seen: Sightings, y0_m: float, shape: RoadCurve, bearing_sigma_rad: float, rounds: int = 3
) -> FittedLine | None:
    """The line near ``y0_m``, of about the shared shape, through the points around it; None with too few points.
    rounds: number of re-weighting rounds."""
    prior = np.array([y0_m, shape.heading_rad, shape.curvature_per_m / 2.0, 0.0])
    x = seen.x_m(shape.pitch_rad)
    ok, mean, cov, x_min, x_max, quality = _fit(
        x, seen.slope * x, seen.slope, seen.weight, prior, _PRIOR_INFO, seen.height_m, bearing_sigma_rad, rounds
    )
    return FittedLine(mean, cov, x_min, x_max, quality) if ok else None


_PRIOR_INFO = 1.0 / np.array([1.0, 0.03, 1.5e-3, 1e-5]) ** 2
"""Permitted deviation of one line from the shared shape: position, heading, half the curvature, its change."""


def _grid(middle: float, reach: float, step: float) -> F64:
    count = int(reach / step + 1e-6)  # values known better than one step are left to the fit
    return np.asarray(middle + step * np.arange(-count, count + 1), np.float64)


@numba.njit(cache=True, nogil=True)
def _vote(slope, inverse, weight, height, headings, bends, pitches):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Sharpness of the lateral histogram for each hypothesis; ties are won by the hypotheses in the middle."""
    best_score = -1.0
    best, best_histogram = np.zeros(3), np.zeros(_BINS)
    x, y, w = np.empty(len(slope)), np.empty(len(slope)), np.empty(len(slope))
    voters, count = np.empty(len(slope), np.int64), 0
    for i in range(len(slope)):  # the same points for every pitch: a pitch that includes more points would seem sharper
        shifted = inverse[i] + pitches[len(pitches) // 2] / height
        if shifted > 1.0 / _VOTE_REACH_M and shifted < 1.0 / _NEAREST_M:
            # rows are dense near the car, so weight by metres instead of rows
            w[count] = weight[i] * min(1.0 / shifted, 20.0)
            voters[count] = i
            count += 1
    for pitch in pitches:
        for k in range(count):
            x[k] = 1.0 / max(inverse[voters[k]] + pitch / height, 1.0 / _FARTHEST_M)
            y[k] = slope[voters[k]] * x[k]
        for heading in headings:
            for bend in bends:
                histogram = np.zeros(_BINS)
                for i in range(count):
                    place = (y[i] - heading * x[i] - 0.5 * bend * x[i] * x[i]) / _BIN_M + _BINS / 2
                    if place >= 0.0 and place < _BINS:
                        histogram[int(place)] += w[i]
                score = 0.0
                for k in range(1, _BINS):
                    score += (histogram[k - 1] + histogram[k]) ** 2
                off = ((heading - headings[len(headings) // 2]) / 0.08) ** 2
                off += ((bend - bends[len(bends) // 2]) / 0.008) ** 2
                off += ((pitch - pitches[len(pitches) // 2]) / 0.02) ** 2
                score *= np.exp(-0.15 * off)
                if score > best_score:
                    best_score = score
                    best[0], best[1], best[2] = heading, bend, pitch
                    for k in range(len(histogram)):
                        best_histogram[k] = histogram[k]
    return best, best_histogram


@numba.njit(cache=True, nogil=True)
def _fit(x, y, slope, weight, prior, prior_info, height, bearing_sigma, rounds):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Iteratively re-weighted least squares with a prior, in x/10 so that the normal matrix is well conditioned."""
    mean, cov, info = prior.copy(), np.zeros((4, 4)), np.zeros((4, 4))
    scale = np.array([1.0, 0.1, 0.01, 0.001])
    covered = np.zeros(_COVER_BINS)
    x_min = x_max = 0.0
    near = inside = score = 0.0
    count = 0
    for turn in range(rounds):
        narrow = 1.0 - (1.0 - _LAST_GATE) * turn / max(rounds - 1, 1)
        sums, right = np.zeros(7), np.zeros(4)  # sums of the powers of x/10 up to 6, which define the Hankel matrix
        covered[:] = 0.0
        x_min, x_max = 1e9, 0.0
        near = inside = score = 0.0
        count = 0
        for i in range(len(x)):
            if not (x[i] > _NEAREST_M and x[i] < _FARTHEST_M):
                continue
            expected = mean[0] + x[i] * (mean[1] + x[i] * (mean[2] + x[i] * mean[3]))
            residual = y[i] - expected
            gate = narrow * (_WIDE_GATE_M + _GATE_PER_M * x[i])
            if abs(residual) > _AROUND * gate:
                continue
            near += weight[i]
            if abs(residual) > gate:
                continue
            skew = (slope[i] - mean[1]) * x[i] * x[i] * bearing_sigma / height
            variance = _PAINT_SIGMA_M**2 + (x[i] * bearing_sigma) ** 2 + skew * skew
            trust = weight[i] / (variance * _SHARED_ERROR) / (1.0 + residual * residual / (4.0 * variance + 0.01))
            step = x[i] / 10.0
            power = trust
            for k in range(7):
                sums[k] += power
                if k < 4:
                    right[k] += power * y[i]
                power *= step
            inside += weight[i]
            count += 1
            score += weight[i] * weight[i]
            x_min, x_max = min(x_min, x[i]), max(x_max, x[i])
            piece = int((x[i] - _COVER_FROM_M) / _COVER_STEP_M)
            if piece >= 0 and piece < _COVER_BINS:
                covered[piece] = 1.0
        if inside < 1.0:
            return False, mean, cov, 0.0, 0.0, 0.0
        for a in range(4):
            for b in range(4):
                info[a, b] = sums[a + b]
            info[a, a] += prior_info[a] * scale[a] * scale[a]
            right[a] += prior_info[a] * scale[a] * prior[a]
        inverse_info = np.linalg.inv(info)
        solved = inverse_info @ right
        for k in range(4):
            mean[k] = solved[k] * scale[k]
            for b in range(4):
                cov[k, b] = inverse_info[k, b] * scale[k] * scale[b]
    clear = max(0.0, inside / near - _BY_CHANCE) / (1.0 - _BY_CHANCE)
    support = min(1.0, covered.sum() / _ENOUGH_COVER) * min(1.0, count / _ENOUGH_POINTS)
    quality = support * clear * min(1.0, 1.5 * score / inside)
    return True, mean, cov, x_min, x_max, quality
