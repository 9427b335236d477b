"""Gives a standing vehicle one position over ground: the best of all sweeps, instead of each sweep's own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.labels.headings import Pose, in_ego, over_ground
from pipeline.types import F64

_FEWEST = 4
_DRIFT_SHARE, _DRIFT_MPS = 0.05, 0.2
"""A standing vehicle seems to move at the error of the own speed: up to 5 % of it (wheels and tyres; UN R39 permits
10 % on the display), and 0.2 m/s. What moves faster than that drives."""
_LOOSE_M = 0.8
"""If positions deviate more than this (median) from a standing vehicle's, its track is on more than one vehicle."""
_ON_SIDE_M = 0.15
"""Accuracy of a side with points on it. Positions farther off count less. If the positions (median, weighted by points)
deviate more from a standing vehicle's, it does not stand, or own motion is wrong: at a street corner of Astyx's further
frames, with sweeps half a second apart, it was half a metre off, and fitting made 37 % of the boxes worse. With this
limit, the median IoU there is 0.71 instead of 0.62; limits up to 0.8 m make no difference on the other drives."""
_STEPS = 10
"""Of iteratively reweighted least squares."""


def held_still(
    cuboids: Mapping[int, Cuboid], points: Mapping[int, int], poses: Mapping[int, Pose]
) -> dict[int, Cuboid]:
    """The cuboids of a track, by frame, at one position over ground if it stands; otherwise as they are.

    Args:
        cuboids: of the track, by frame.
        points: number of points that each was fitted to; frames without are moved along.
        poses: own motion by frame, if known.
    """
    stands = _standing(cuboids, points, poses)
    if stands is None:
        return dict(cuboids)
    return {
        frame: cuboid._replace(center=(*in_ego(*stands.at(pose), pose), cuboid.center[2]))
        if (pose := poses.get(frame)) is not None and pose.stretch == stands.stretch
        else cuboid
        for frame, cuboid in cuboids.items()
    }


def strays(cuboids: Mapping[int, Cuboid], poses: Mapping[int, Pose]) -> set[int]:
    """Frames in which the track of a standing vehicle was on something else: the middle of its cuboid is outside the
    vehicle. cuboids: as seen in single sweeps, by frame. poses: own motion by frame, if known."""
    frames = [frame for frame in cuboids if frame in poses]
    if len(frames) < _FEWEST or len({poses[frame].stretch for frame in frames}) > 1:
        return set()
    where = np.array([over_ground(cuboids[frame], poses[frame]) for frame in frames])
    # the middle value: a line would follow strays at the end of a track
    off_m = np.hypot(*(where - np.median(where, axis=0)).T)
    if float(np.median(off_m)) > _LOOSE_M:
        return set()
    return {frame for frame, off in zip(frames, off_m, strict=True) if off > cuboids[frame].size[0] / 2}


@dataclass(frozen=True)
class _Standing:
    """Position of a standing vehicle over ground, which drifts with the error of the own speed."""

    stretch: int
    line: F64
    """(2, 2) position and velocity."""
    middle_s: float
    """Time of the position."""

    def at(self, pose: Pose) -> tuple[float, float]:
        """x, y over ground at the time of a pose."""
        x, y = self.line[0] + (pose.t_s - self.middle_s) * self.line[1]
        return float(x), float(y)


def _standing(
    cuboids: Mapping[int, Cuboid], weights: Mapping[int, float], poses: Mapping[int, Pose]
) -> _Standing | None:
    """None if it does not certainly stand. weights: of the frames to be used."""
    frames = [frame for frame in sorted(weights) if frame in poses and frame in cuboids]
    if len(frames) < _FEWEST or len({poses[frame].stretch for frame in frames}) > 1:
        return None
    here = [poses[frame] for frame in frames]
    times = np.array([pose.t_s for pose in here])
    middle_s = float(times.mean())
    where = np.array([over_ground(cuboids[frame], pose) for frame, pose in zip(frames, here, strict=True)])
    points = np.array([weights[frame] for frame in frames], dtype=float)
    line, off_m = _line(times - middle_s, where, points)
    own_mps = abs(here[-1].way_m - here[0].way_m) / max(float(np.ptp(times)), 1e-9)
    if math.hypot(*line[1]) > _DRIFT_SHARE * own_mps + _DRIFT_MPS or weighted_median(off_m, points) > _ON_SIDE_M:
        return None
    return _Standing(here[0].stretch, line, middle_s)


def _line(times: F64, where: F64, weights: F64) -> tuple[F64, F64]:
    """(2, 2) position and velocity of a robust fit (Huber weights), and (N,) distances from it.

    times: (N,) s. where: (N, 2) m. weights: (N,).
    """
    terms = np.column_stack([np.ones(len(times)), times])
    trust = np.ones(len(times))
    for _ in range(_STEPS):
        root = np.sqrt(weights * trust)[:, None]
        line = np.linalg.lstsq(terms * root, where * root, rcond=None)[0]
        off_m = np.hypot(*(where - terms @ line).T)
        trust = _ON_SIDE_M / np.maximum(off_m, _ON_SIDE_M)
    return line, off_m


def weighted_median(values: Sequence[float] | F64, weights: Sequence[float] | F64) -> float:
    """The value below which half of the weight lies."""
    return weighted_quantile(values, weights, 0.5)


def weighted_quantile(values: Sequence[float] | F64, weights: Sequence[float] | F64, share: float) -> float:
    """The value below which this share of the weight lies."""
    order = np.argsort(values)
    total = np.cumsum(np.asarray(weights, dtype=float)[order])
    return float(values[order[int(np.searchsorted(total, total[-1] * share))]])
