"""The heading of a vehicle from its side, where its points lie along one straight line.

A box around points of a car has a yaw error of 3° to 5°, because its corners are round and its windows lie further in
than its doors. But if one side is nearly all that was seen, and over a longer part than any car is wide, a straight
line through it is parallel to the vehicle: within 0.5° of the labels (median of 13 such aggregates on KITTI drive 0009
and on Astyx's further frames, 3.5° at most), where the road's direction was within 2.1°.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.types import F32, F64

_SHORTEST_M = 2.0
"""A shorter line may be a rear, which is curved."""
_MOST_OF_THEM = 0.6
"""Share of the points on the line. If fewer are, two faces or other bodies were seen, too, and the longest line leans
towards them: with 0.25 to 0.5, its direction was wrong by 4° to 9° on KITTI drive 0009."""
_FEWEST_POINTS = 12
_ON_LINE_M = 0.1
_REACH_RAD, _STEP_RAD = math.radians(20.0), math.radians(1.0)
_MOST_POINTS = 300
_OFFSETS = 60
_PASSES = 3
_SIGMA_RAD = math.radians(1.5)
"""Error of the line's direction."""
_ROAD_RAD = math.radians(2.0)
"""Error of the direction that a cuboid has, if it is aligned with the road."""
_APART = 3.0
"""If they differ by more than this many sigmas, the vehicle is not aligned with the road."""


def side_turn_rad(points: F32, yaw_rad: float) -> float | None:
    """Rotation that aligns a cuboid with the line through its side; None if its side was not seen as one.

    points: (N, 4) of the vehicle, of one or several sweeps.
    """
    if len(points) < _FEWEST_POINTS:
        return None
    flat = points[:: -(-len(points) // _MOST_POINTS), :2].astype(np.float64)
    flat -= flat.mean(axis=0)
    turn_rad = max(
        np.arange(-_REACH_RAD, _REACH_RAD + _STEP_RAD / 2, _STEP_RAD),
        key=lambda turn: _best_offset(_across(flat, yaw_rad + turn)[1])[0],
    )
    along, across = _across(flat, yaw_rad + turn_rad)
    left = across - _best_offset(across)[1]
    slope = 0.0
    for _ in range(_PASSES):
        on_line = np.abs(left) < _ON_LINE_M
        if np.count_nonzero(on_line) < _FEWEST_POINTS or np.ptp(along[on_line]) < _SHORTEST_M:
            return None
        slope, offset = np.polyfit(along[on_line], across[on_line], 1)
        left = across - slope * along - offset
    on_line = np.abs(left) < _ON_LINE_M
    length_m = float(np.ptp(np.quantile(along[on_line], [0.03, 0.97]))) if on_line.any() else 0.0
    if length_m < _SHORTEST_M or on_line.mean() < _MOST_OF_THEM:
        return None
    return float(turn_rad + math.atan(slope))


def off_road(turn_rad: float) -> bool:
    """Whether a side with this rotation against a cuboid aligned with the road shows that it is not. Otherwise, the
    road tells its direction better."""
    return abs(turn_rad) > _APART * math.hypot(_SIGMA_RAD, _ROAD_RAD)


def _across(flat: F64, yaw_rad: float) -> tuple[F64, F64]:
    """(N,) along and across a direction."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return flat @ np.array([c, s]), flat @ np.array([-s, c])


def _best_offset(across: F64) -> tuple[float, float]:
    """How many points lie close to the best parallel line, the closer the more, and its offset."""
    offsets = across[:: -(-len(across) // _OFFSETS)]
    near = np.maximum(1.0 - np.abs(across[:, None] - offsets) / _ON_LINE_M, 0.0).sum(axis=0)
    best = int(near.argmax())
    return float(near[best]), float(offsets[best])
