"""Gives a standing vehicle one position over ground: the best of all sweeps, instead of each sweep's own."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.labels.headings import Pose, in_ego, over_ground
from pipeline.types import F64

_FEWEST = 4
_DRIFT_SHARE, _DRIFT_MPS = 0.05, 0.2
"""A standing vehicle seems to move at the error of the own speed: up to 5 % of it (wheels and tyres; UN R39 permits
10 % on the display), and 0.2 m/s. What moves faster than that drives."""
_LOOSE_M = 0.8
"""If positions deviate more than this (median) from a standing vehicle's, it does not stand, or is more than one."""
_FAR_OFF_M = 0.15
"""Positions farther off count less: the accuracy of a side with points on it."""
_STEPS = 10


def held_still(
    cuboids: Mapping[int, Cuboid], points: Mapping[int, int], poses: Mapping[int, Pose]
) -> dict[int, Cuboid]:
    """The cuboids of a track, by frame, at one position over ground if it stands; otherwise as they are.

    Args:
        cuboids: of the track, by frame.
        points: number of points that each was fitted to; frames without are moved along.
        poses: own motion by frame, if known.
    """
    frames = [frame for frame in sorted(points) if frame in poses and frame in cuboids]
    if len(frames) < _FEWEST or len({poses[frame].stretch for frame in frames}) > 1:
        return dict(cuboids)
    here = [poses[frame] for frame in frames]
    times = np.array([pose.t_s for pose in here])
    middle_s = float(times.mean())
    where = np.array([over_ground(cuboids[frame], pose) for frame, pose in zip(frames, here, strict=True)])
    line, off_m = _line(times - middle_s, where, np.array([points[frame] for frame in frames], dtype=float))
    own_mps = abs(here[-1].way_m - here[0].way_m) / max(float(np.ptp(times)), 1e-9)
    if math.hypot(*line[1]) > _DRIFT_SHARE * own_mps + _DRIFT_MPS or float(np.median(off_m)) > _LOOSE_M:
        return dict(cuboids)
    found = dict(cuboids)
    for frame, cuboid in cuboids.items():
        pose = poses.get(frame)
        if pose is not None and pose.stretch == here[0].stretch:
            x, y = line[0] + (pose.t_s - middle_s) * line[1]
            found[frame] = cuboid._replace(center=(*in_ego(float(x), float(y), pose), cuboid.center[2]))
    return found


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
        trust = _FAR_OFF_M / np.maximum(off_m, _FAR_OFF_M)
    return line, off_m
