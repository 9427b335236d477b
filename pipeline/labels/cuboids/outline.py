"""Measures how far a vehicle's points extend along the sides of a cuboid, which sides were seen, and how well one
fits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.types import F32, F64

_EDGE = 0.02
"""Of the points lie outside: single ones beside the vehicle."""
_ON_SIDE_M = 0.12
_FEWEST_ON_SIDE = 5
_SHARE_OF_EYES = 0.3
"""Of the sweeps must have seen a side that a cuboid is laid on: from the others it was hidden by the vehicle itself."""
_MOST_OF_IT = 0.75
"""A rear that we see from behind over so much of its width is seen between its edges: its middle is the vehicle's."""
_CAP_M = 0.4
"""Points farther off than this are of something else: how much farther says nothing."""

EndsSeen = Literal["low", "high", "both", "none"]
"""Which end of an axis was turned to us."""


@dataclass(frozen=True)
class Outline:
    """Along length and width of a cuboid, from the ego origin of its frame."""

    axes: F64
    """(2, 2) unit vectors of length and width, as rows."""
    low: F64
    """(2,) where the points begin."""
    high: F64
    """(2,) where they end."""
    seen: tuple[EndsSeen, EndsSeen]
    """Ends that were turned to the sensor in one sweep at least."""
    firm: tuple[EndsSeen, EndsSeen]
    """Those that many sweeps saw and that have points along them: a cuboid can be laid on these."""

    @property
    def span(self) -> F64:
        """(2,) metres."""
        return np.asarray(self.high - self.low)


def outline(points: F32, eyes: F64, yaw_rad: float) -> Outline:
    """points: (N, 4) of a vehicle. eyes: (K, 2) where they were seen from."""
    axes = np.array([[math.cos(yaw_rad), math.sin(yaw_rad)], [-math.sin(yaw_rad), math.cos(yaw_rad)]])
    flat, from_where = points[:, :2].astype(np.float64) @ axes.T, eyes @ axes.T
    low, high = np.quantile(flat, [_EDGE, 1.0 - _EDGE], axis=0)
    seen: list[EndsSeen] = []
    firm: list[EndsSeen] = []
    for axis in range(2):
        before, behind = from_where[:, axis] < low[axis], from_where[:, axis] > high[axis]
        seen.append(_side(before.any(), behind.any()))
        on_low = int((np.abs(flat[:, axis] - low[axis]) < _ON_SIDE_M).sum()) >= _FEWEST_ON_SIDE
        on_high = int((np.abs(flat[:, axis] - high[axis]) < _ON_SIDE_M).sum()) >= _FEWEST_ON_SIDE
        firm.append(_side(before.mean() > _SHARE_OF_EYES and on_low, behind.mean() > _SHARE_OF_EYES and on_high))
    return Outline(axes, low, high, (seen[0], seen[1]), (firm[0], firm[1]))


def placed(
    found: Outline, cuboid: Cuboid, size: Sequence[float], ends: tuple[EndsSeen, EndsSeen]
) -> tuple[float, float]:
    """x, y of the middle of a footprint of this length and width: the ends that were seen are laid on the points; a
    side that was seen between both its ends is centred; else it is moved just as far as it must be to hold them. ends:
    which are believed."""
    middle = found.axes @ np.array(cuboid.center[:2])
    for axis in range(2):
        low, high, side = found.low[axis], found.high[axis], size[axis]
        is_between = ends[axis] == "none" and found.seen[axis] == "none" and high - low >= _MOST_OF_IT * side
        if ends[axis] == "both" or is_between:
            middle[axis] = (low + high) / 2
        elif ends[axis] == "low":
            middle[axis] = low + side / 2
        elif ends[axis] == "high":
            middle[axis] = high - side / 2
        else:
            middle[axis] = np.clip(middle[axis], *sorted((high - side / 2, low + side / 2)))
    x, y = found.axes.T @ middle
    return float(x), float(y)


def misfit_m(points: F32, eyes: F64, cuboid: Cuboid) -> float:
    """How far points are, in the mean, from the nearest side of a cuboid that was turned to us, and outside of it."""
    c, s = math.cos(cuboid.yaw_rad), math.sin(cuboid.yaw_rad)
    axes = np.array([[c, s], [-s, c]])
    flat = (points[:, :2].astype(np.float64) - cuboid.center[:2]) @ axes.T
    from_where = (eyes - cuboid.center[:2]) @ axes.T
    half = np.array(cuboid.size[:2]) / 2
    outside = np.maximum(np.abs(flat) - half, 0.0).max(axis=1)
    away = [
        np.abs(flat[:, axis] - sign * half[axis])
        for axis in range(2)
        for sign in (-1.0, 1.0)
        if (sign * from_where[:, axis] > half[axis]).any()
    ]
    beside = np.min(away, axis=0) if away else outside
    return float(np.minimum(beside, _CAP_M).mean() + np.minimum(outside, _CAP_M).mean())


def _side(low: bool | np.bool_, high: bool | np.bool_) -> EndsSeen:
    if low and high:
        return "both"
    return "low" if low else "high" if high else "none"
