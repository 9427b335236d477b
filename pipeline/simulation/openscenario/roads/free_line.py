"""Lines in the file's world that follow no road: polylines with rounded corners, clothoids and NURBS, as arcs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import atan2, cos, hypot, remainder, sin, tan, tau

import numpy as np
from scipy.interpolate import BSpline

from pipeline.simulation.openscenario.roads.arc_fit import fit_arcs
from pipeline.simulation.world.lines import RoadLine, WorldPose
from pipeline.simulation.world.roads import transition_arcs
from pipeline.types import F64

CORNER_M = 0.2
"""Distance by which a rounded corner of a polyline passes its vertex at most."""
LONGEST_M = 10_000.0
"""Longer lines are not followed."""
_SAME_M, _STRAIGHT_RAD = 1e-6, 1e-6
_SEARCH_STEP_M, _NURBS_STEP_M = 0.5, 0.1
_MOST_SAMPLES = 50_000
_CONVERGED_M = 1e-9
_MOST_STEPS, _SLOWEST = 20, 0.2

Arc = tuple[float, float]
"""Length and curvature."""


@dataclass(frozen=True)
class FreeLine:
    """A line of arcs without kinks; it continues straight or as its outer arcs."""

    arcs: tuple[Arc, ...]
    """Length and curvature per metre of each, positive to the left."""
    start: WorldPose
    """x, y, heading."""

    @cached_property
    def line(self) -> RoadLine:
        return RoadLine(self.arcs, self.start)

    @cached_property
    def length_m(self) -> float:
        return sum(length for length, _ in self.arcs)

    def pose(self, s_m: float) -> WorldPose:
        """x, y and heading at s."""
        x, y, heading = self.line.to_world(s_m, 0.0)[0].tolist()
        return x, y, heading

    def project(self, x_m: float, y_m: float) -> float:
        """s of the nearest place."""
        s = np.arange(0.0, self.length_m + _SEARCH_STEP_M, _SEARCH_STEP_M)
        there = self.line.to_world(s, 0.0)
        s_m = float(s[int(np.argmin(np.hypot(there[:, 0] - x_m, there[:, 1] - y_m)))])
        for _ in range(_MOST_STEPS):
            x, y, heading = self.pose(s_m)
            step_m = (x_m - x) * cos(heading) + (y_m - y) * sin(heading)
            d_m = (y_m - y) * cos(heading) - (x_m - x) * sin(heading)
            step_m /= max(1.0 - self._bend(s_m) * d_m, _SLOWEST)
            s_m += step_m
            if abs(step_m) < _CONVERGED_M:
                break
        return s_m

    def _bend(self, s_m: float) -> float:
        for length, bend in self.arcs:
            if s_m < length:
                return bend
            s_m -= length
        return self.arcs[-1][1]

    def from_m(self, s_m: float) -> FreeLine:
        """The part from s on; s may lie outside the line."""
        left_m, arcs = s_m, list(self.arcs)
        while len(arcs) > 1 and left_m >= arcs[0][0]:
            left_m -= arcs.pop(0)[0]
        length, bend = arcs[0]
        arcs[0] = max(length - left_m, _SAME_M), bend
        return FreeLine(tuple(arcs), self.pose(s_m))

    def until_m(self, s_m: float) -> FreeLine:
        """The part up to s."""
        arcs: list[Arc] = []
        for length, bend in self.arcs:
            if s_m <= _SAME_M:
                break
            arcs.append((min(length, s_m), bend))
            s_m -= length
        if s_m > _SAME_M and arcs:
            arcs[-1] = arcs[-1][0] + s_m, arcs[-1][1]
        return FreeLine(tuple(arcs) or ((_SAME_M, 0.0),), self.start)

    def then(self, other: FreeLine) -> FreeLine:
        """This line and another that begins where it ends."""
        return FreeLine((*self.arcs, *other.arcs), self.start)


def straight(pose: WorldPose, length_m: float = 1.0) -> FreeLine:
    """From a pose straight on."""
    return FreeLine(((length_m, 0.0),), pose)


def through_poses(poses: F64) -> FreeLine:
    """(N, 3) samples of a smooth curve, x, y, heading, fitted within 1 cm. Samples that coincide are left out."""
    moved = np.concatenate([[True], np.hypot(*np.diff(poses[:, :2], axis=0).T) > _SAME_M])
    kept = poses[moved]
    x, y, heading = kept[0].tolist()
    if len(kept) < 2:
        return straight((x, y, heading))
    return FreeLine(tuple(fit_arcs(kept).arcs), (x, y, heading))


def polyline(points: list[tuple[float, float]]) -> tuple[FreeLine, list[float]]:
    """A line along two or more points, and s of each. Corners are rounded: they pass the point within ``CORNER_M``.
    ValueError if all points coincide, or the line turns back on itself."""
    kept = [0]
    for number in range(1, len(points)):
        if hypot(points[number][0] - points[kept[-1]][0], points[number][1] - points[kept[-1]][1]) > _SAME_M:
            kept.append(number)
    if len(kept) < 2:
        raise ValueError("all its points coincide")
    steps = np.diff(np.array([points[number] for number in kept]), axis=0)
    lengths, headings = np.hypot(*steps.T).tolist(), np.arctan2(steps[:, 1], steps[:, 0]).tolist()
    turns = [remainder(b - a, tau) for a, b in pairwise(headings)]
    if any(abs(turn) > 3.0 for turn in turns):
        raise ValueError("it turns back on itself")
    cuts = [
        0.0,
        *(_cut_m(turn, *pair) for turn, pair in zip(turns, pairwise(lengths), strict=True)),
        0.0,
    ]
    arcs: list[Arc] = []
    at_m, s_m = [0.0], 0.0
    for number, length in enumerate(lengths):
        before, after = cuts[number], cuts[number + 1]
        if length - before - after > _SAME_M:
            arcs.append((length - before - after, 0.0))
            s_m += length - before - after
        if number < len(turns) and after > 0.0:
            radius = after / tan(abs(turns[number]) / 2)
            arcs.append((radius * abs(turns[number]), (1.0 if turns[number] > 0.0 else -1.0) / radius))
            at_m.append(s_m + arcs[-1][0] / 2)
            s_m += arcs[-1][0]
        else:
            at_m.append(s_m)
    starts = [at_m[max(i for i, number in enumerate(kept) if number <= each)] for each in range(len(points))]
    return FreeLine(tuple(arcs), (*points[0], headings[0])), starts


def _cut_m(turn_rad: float, before_m: float, after_m: float) -> float:
    """How far before a corner its rounding begins: the arc passes the corner by cut · tan(turn / 4)."""
    if abs(turn_rad) < _STRAIGHT_RAD:
        return 0.0
    return min(CORNER_M / tan(abs(turn_rad) / 4), before_m / 2, after_m / 2)


def clothoid(start: WorldPose, length_m: float, from_per_m: float, to_per_m: float) -> FreeLine:
    """A curve whose curvature changes linearly."""
    if from_per_m == to_per_m:
        return FreeLine(((length_m, from_per_m),), start)
    return FreeLine(tuple(transition_arcs(length_m, from_per_m, to_per_m)), start)


def nurbs(points: F64, weights: F64, knots: F64, order: int) -> tuple[FreeLine, list[float]]:
    """A non-uniform rational B-spline of the given order (degree + 1) through its valid range of knots, and s of the
    place nearest to each control point. points: (N, 2); weights: (N,); knots: (N + order,), ascending. ValueError for
    other numbers, or a curve with a cusp."""
    if not 2 <= order <= len(points) or len(knots) != len(points) + order:
        raise ValueError(f"{len(points)} control points and order {order} need {len(points) + order} knots")
    if (np.diff(knots) < 0.0).any() or (weights <= 0.0).any() or knots[order - 1] >= knots[len(points)]:
        raise ValueError("knots must ascend, and weights be positive")
    homogeneous = BSpline(knots, np.column_stack([points * weights[:, None], weights]), order - 1)
    rough_m = float(np.hypot(*np.diff(points, axis=0).T).sum())
    if rough_m > LONGEST_M:
        raise ValueError(f"its control points are more than {LONGEST_M / 1e3:g} km apart")
    count = int(min(max(rough_m / _NURBS_STEP_M, 8 * len(points)), _MOST_SAMPLES))
    at = np.linspace(knots[order - 1], knots[len(points)], count)
    (x, y, w), (dx, dy, dw) = homogeneous(at).T, homogeneous.derivative()(at).T
    along = np.column_stack([dx * w - x * dw, dy * w - y * dw])
    if float(np.hypot(*along.T).min()) <= _SAME_M * rough_m:
        raise ValueError("the curve stands still or has a cusp")
    poses = np.column_stack([x / w, y / w, np.unwrap(np.arctan2(along[:, 1], along[:, 0]))])
    line = through_poses(poses)
    return line, [line.project(px, py) for px, py in points.tolist()]


def overlaps(one: F64, other: F64) -> bool:
    """Whether two rectangles, (4, 2) corners each, have a point in common: no side of either separates them."""
    for corners in (one, other):
        for side in np.diff(corners[:3], axis=0):
            a, b = one @ side, other @ side
            if a.max() < b.min() or b.max() < a.min():
                return False
    return True


def turned_rad(one: float, other: float) -> float:
    """Angle between two directions, 0 to π."""
    return abs(atan2(sin(one - other), cos(one - other)))
