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
"""Share of the points that may lie outside: single points beside the vehicle."""
_ON_SIDE_M = 0.12
_FEWEST_ON_SIDE = 5
_SHARE_OF_EYES = 0.3
"""Share of the sweeps that must have seen a side for it to be used: in the others it was hidden by the vehicle
itself."""
MOST_OF_IT = 0.75
"""If a rear is seen from behind over at least this share of its width, both its edges are visible, so its middle is the
vehicle's."""
_CAP_M = 0.4
"""Points farther off belong to something else, so their distance is capped."""

EndsSeen = Literal["low", "high", "both", "none"]
"""Which end of an axis faced the sensor."""


@dataclass(frozen=True)
class Outline:
    """Extent along length and width of a cuboid, relative to the ego origin of its frame."""

    axes: F64
    """(2, 2) unit vectors of length and width, as rows."""
    low: F64
    """(2,) minimum of the points."""
    high: F64
    """(2,) maximum of the points."""
    seen: tuple[EndsSeen, EndsSeen]
    """Ends that faced the sensor in at least one sweep."""
    firm: tuple[EndsSeen, EndsSeen]
    """Ends that were seen in many sweeps and have points along them, so that a cuboid can be fitted to them."""
    far_end_rad: tuple[float, float]
    """Per axis, the largest angle between the side along it and the beams to that side's far end, in the sweep that saw
    it best; 0 if no sweep saw that side. A side seen at a small angle has few points towards its far end."""

    @property
    def span(self) -> F64:
        """(2,) metres."""
        return np.asarray(self.high - self.low)


def outline(points: F32, eyes: F64, yaw_rad: float) -> Outline:
    """points: (N, 4) of a vehicle. eyes: (K, 2) sensor positions."""
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
    far = (_far_end_rad(from_where, low, high), _far_end_rad(from_where[:, ::-1], low[::-1], high[::-1]))
    return Outline(axes, low, high, (seen[0], seen[1]), (firm[0], firm[1]), far)


def extent(points: F32, yaw_rad: float) -> F64:
    """(2,) length and width of (N, 4) points in this direction, without single points beside them."""
    axes = np.array([[math.cos(yaw_rad), math.sin(yaw_rad)], [-math.sin(yaw_rad), math.cos(yaw_rad)]])
    low, high = np.quantile(points[:, :2].astype(np.float64) @ axes.T, [_EDGE, 1.0 - _EDGE], axis=0)
    return np.asarray(high - low)


def _far_end_rad(eyes: F64, low: F64, high: F64) -> float:
    """eyes: (K, 2) along and across a side. low, high: (2,) extent of the points."""
    beside = np.maximum(low[1] - eyes[:, 1], eyes[:, 1] - high[1])
    along = np.maximum(np.abs(eyes[:, 0] - low[0]), np.abs(eyes[:, 0] - high[0]))
    return float(np.maximum(np.arctan2(beside, along), 0.0).max())


def placed(
    found: Outline, cuboid: Cuboid, size: Sequence[float], ends: tuple[EndsSeen, EndsSeen]
) -> tuple[float, float]:
    """x, y of the centre of a footprint with this length and width: visible ends are aligned with the points; a side
    with both ends visible is centred; otherwise it is moved as little as needed to contain the points. ends: ends to be
    used."""
    middle = found.axes @ np.array(cuboid.center[:2])
    for axis in range(2):
        low, high, side = found.low[axis], found.high[axis], size[axis]
        is_between = ends[axis] == "none" and found.seen[axis] == "none" and high - low >= MOST_OF_IT * side
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
    """Mean distance of the points from the nearest side of the cuboid that faced the sensor, and outside of it."""
    axes, half = _axes(cuboid), np.array(cuboid.size[:2]) / 2
    flat = (points[:, :2].astype(np.float64) - cuboid.center[:2]) @ axes.T
    from_where = (eyes - cuboid.center[:2]) @ axes.T
    outside = np.maximum(np.abs(flat) - half, 0.0).max(axis=1)
    away = [
        np.abs(flat[:, axis] - sign * half[axis])
        for axis in range(2)
        for sign in (-1.0, 1.0)
        if (sign * from_where[:, axis] > half[axis]).any()
    ]
    beside = np.min(away, axis=0) if away else outside
    return float(np.minimum(beside, _CAP_M).mean() + np.minimum(outside, _CAP_M).mean())


def outside_m(points: F32, cuboid: Cuboid) -> float:
    """Mean distance of the points outside of the cuboid, seen from above; those inside count as 0."""
    flat = (points[:, :2].astype(np.float64) - cuboid.center[:2]) @ _axes(cuboid).T
    outside = np.maximum(np.abs(flat) - np.array(cuboid.size[:2]) / 2, 0.0).max(axis=1)
    return float(np.minimum(outside, _CAP_M).mean())


def _axes(cuboid: Cuboid) -> F64:
    """(2, 2) unit vectors of length and width, as rows."""
    c, s = math.cos(cuboid.yaw_rad), math.sin(cuboid.yaw_rad)
    return np.array([[c, s], [-s, c]])


def _side(low: bool | np.bool_, high: bool | np.bool_) -> EndsSeen:
    if low and high:
        return "both"
    return "low" if low else "high" if high else "none"
